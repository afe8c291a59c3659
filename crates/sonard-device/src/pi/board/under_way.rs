//! What the board is at: a move, a firing.

use firmware_protocol::messages::{Echoes, limits::TICK_HZ};
use sonard_model::motion::Trapezoid;

use super::LOOK_TICKS;

/// A move under way.
#[derive(Debug)]
pub(super) struct Turn {
    pub(super) motion: Trapezoid,
    pub(super) since: u64,
    pub(super) pulses: u32,
    /// Brake when the index sensor reads so.
    pub(super) watch: Option<bool>,
    pub(super) seen: Option<i32>,
}

/// A firing under way. Times are ticks.
#[derive(Debug)]
pub(super) struct Listening {
    pub(super) fired: u64,
    pub(super) until: u64,
    pub(super) binh_at: Option<u64>,
    pub(super) blnk_until: Option<u64>,
    pub(super) max_echoes: u8,
    pub(super) echoes: Echoes,
}

impl Turn {
    pub(super) const fn is_under_way(&self) -> bool {
        self.pulses < self.motion.steps().unsigned_abs()
    }

    /// When the next pulse is to come, or the motor stands.
    pub(super) fn due(&self) -> u64 {
        let at_s = if self.is_under_way() {
            self.motion.pulse_s(self.pulses + 1)
        } else {
            self.motion.duration_s()
        };
        self.since + (at_s * f64::from(TICK_HZ)).ceil() as u64
    }

    /// Brakes as fast as the acceleration allows.
    pub(super) fn brake(&mut self, now: u64) {
        self.watch = None;
        let time_s = now.saturating_sub(self.since) as f64 / f64::from(TICK_HZ);
        // A pulse that has gone out can't be taken back: then the motor stands after it.
        self.motion = self.motion.braked(time_s);
    }
}

impl Listening {
    pub(super) fn due(&self, now: u64) -> u64 {
        let look =
            (self.echoes.len() + 1 < usize::from(self.max_echoes)).then_some(now + LOOK_TICKS);
        [Some(self.until), self.binh_at, self.blnk_until, look]
            .into_iter()
            .flatten()
            .min()
            .unwrap_or(self.until)
    }

    /// Takes an echo in; whether the module is to be made ready for another.
    pub(super) fn hears(&mut self, at: u64) -> bool {
        let wanted = usize::from(self.max_echoes);
        if at < self.fired || at > self.until || self.echoes.len() >= wanted {
            return false;
        }
        let after = u32::try_from(at - self.fired).unwrap_or(u32::MAX);
        self.echoes.push(after).is_ok() && self.echoes.len() < wanted
    }
}
