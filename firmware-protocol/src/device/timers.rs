//! Timers of the device, on a wrapping 32-bit clock.

/// Timers of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceTimer {
    /// Settling time between a move and firing.
    Settle,
    /// Minimum time between firings.
    MinInterval,
    /// End of a sweep whose host sends nothing.
    Lease,
    /// Release of idle coils while the host sends nothing.
    Hold,
}

/// Deadlines in ticks; each is less than half a turn of the clock ahead.
#[derive(Debug, Clone, Default)]
pub(super) struct Timers {
    pub(super) settle: Option<u32>,
    pub(super) min_interval: Option<u32>,
    pub(super) lease: Option<u32>,
    pub(super) hold: Option<u32>,
}

impl Timers {
    /// Returns the timer that expires first after `now`.
    pub(super) fn earliest(&self, now: u32) -> Option<(DeviceTimer, u32)> {
        let mut first = None;
        replace_if_earlier(now, &mut first, DeviceTimer::Settle, self.settle);
        replace_if_earlier(now, &mut first, DeviceTimer::MinInterval, self.min_interval);
        replace_if_earlier(now, &mut first, DeviceTimer::Lease, self.lease);
        replace_if_earlier(now, &mut first, DeviceTimer::Hold, self.hold);
        first
    }
}

/// Replaces `first` by `timer` if that expires earlier.
// Not inlined, like `expire`: four copies of either are too large for a microcontroller.
#[inline(never)]
fn replace_if_earlier(
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

/// Clears `slot` and returns `true` if its deadline has passed.
#[inline(never)]
pub(super) fn expire(slot: &mut Option<u32>, now: u32) -> bool {
    let expired = slot.is_some_and(|at| ticks_until(now, at) <= 0);
    if expired {
        *slot = None;
    }
    expired
}

/// Ticks from `now` until `at`; negative if `at` has passed.
#[expect(clippy::cast_possible_wrap, reason = "serial arithmetic on a clock that wraps")]
pub(super) const fn ticks_until(now: u32, at: u32) -> i32 {
    at.wrapping_sub(now) as i32
}
