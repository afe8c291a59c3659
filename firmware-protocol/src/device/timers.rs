//! The device's timers, on a clock of 32 bits that wraps.

/// Everything the device may wait for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceTimer {
    /// The rest after a move, before firing.
    Settle,
    /// The least time from firing to firing.
    MinInterval,
    /// A sweep ends when the host is silent for longer.
    Lease,
    /// Idle coils are released when the host is silent for longer.
    Hold,
}

/// Deadlines in ticks; each lies less than half a turn of the clock ahead.
#[derive(Debug, Clone, Default)]
pub(super) struct Timers {
    pub(super) settle: Option<u32>,
    pub(super) min_interval: Option<u32>,
    pub(super) lease: Option<u32>,
    pub(super) hold: Option<u32>,
}

impl Timers {
    /// The timer that ends first, seen from `now`.
    pub(super) fn earliest(&self, now: u32) -> Option<(DeviceTimer, u32)> {
        let mut first = None;
        sooner(now, &mut first, DeviceTimer::Settle, self.settle);
        sooner(now, &mut first, DeviceTimer::MinInterval, self.min_interval);
        sooner(now, &mut first, DeviceTimer::Lease, self.lease);
        sooner(now, &mut first, DeviceTimer::Hold, self.hold);
        first
    }
}

/// Puts `timer` in the place of `first` if it ends before it.
// Not inlined, as `expire`: four copies of either are much for a microcontroller.
#[inline(never)]
fn sooner(
    now: u32,
    first: &mut Option<(DeviceTimer, u32)>,
    timer: DeviceTimer,
    deadline: Option<u32>,
) {
    let Some(at) = deadline else { return };
    match *first {
        Some((_, best)) if ticks_until(now, at) >= ticks_until(now, best) => {}
        _ => *first = Some((timer, at)),
    }
}

/// Whether `slot` holds a deadline that has passed; if so it is cleared.
#[inline(never)]
pub(super) fn expire(slot: &mut Option<u32>, now: u32) -> bool {
    let over = slot.is_some_and(|at| ticks_until(now, at) <= 0);
    if over {
        *slot = None;
    }
    over
}

/// Ticks from `now` to `at`; negative if `at` has passed.
#[expect(clippy::cast_possible_wrap, reason = "serial arithmetic on a clock that wraps")]
pub(super) const fn ticks_until(now: u32, at: u32) -> i32 {
    at.wrapping_sub(now) as i32
}
