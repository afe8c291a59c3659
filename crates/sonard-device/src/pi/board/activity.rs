//! Activities of the board: a move, a firing.

use firmware_protocol::messages::{Echoes, limits::TICK_HZ};
use sonard_model::motion::Trapezoid;

use super::ECHO_POLL_TICKS;

/// Current move of the motor.
#[derive(Debug)]
pub(super) struct Move {
    pub(super) profile: Trapezoid,
    pub(super) since: u64,
    pub(super) pulses: u32,
    /// State of the index sensor at which the motor brakes.
    pub(super) stop_at: Option<bool>,
    /// Position at which the index sensor reached that state.
    pub(super) edge: Option<i32>,
}

/// Current firing and its listening window. Times are ticks.
#[derive(Debug)]
pub(super) struct Firing {
    pub(super) fired: u64,
    pub(super) until: u64,
    pub(super) binh_at: Option<u64>,
    pub(super) blnk_until: Option<u64>,
    pub(super) max_echoes: u8,
    pub(super) echoes: Echoes,
}

impl Move {
    pub(super) const fn has_pulses_left(&self) -> bool {
        self.pulses < self.profile.steps().unsigned_abs()
    }

    /// Time of the next pulse, or of the end of the move after the last one.
    pub(super) fn due(&self) -> u64 {
        let at_s = if self.has_pulses_left() {
            self.profile.pulse_time_s(self.pulses + 1)
        } else {
            self.profile.duration_s()
        };
        self.since + (at_s * f64::from(TICK_HZ)).ceil() as u64
    }

    /// Brakes as fast as the acceleration allows.
    pub(super) fn brake(&mut self, now: u64) {
        self.stop_at = None;
        let time_s = now.saturating_sub(self.since) as f64 / f64::from(TICK_HZ);
        // A pulse already emitted can't be revoked: the motor stops after it at the earliest.
        self.profile = self.profile.braked(time_s);
    }
}

impl Firing {
    pub(super) fn due(&self, now: u64) -> u64 {
        let poll =
            (self.echoes.len() + 1 < usize::from(self.max_echoes)).then_some(now + ECHO_POLL_TICKS);
        [Some(self.until), self.binh_at, self.blnk_until, poll]
            .into_iter()
            .flatten()
            .min()
            .unwrap_or(self.until)
    }

    /// Records an echo. Returns `true` if the module has to be re-armed for another one.
    pub(super) fn record_echo(&mut self, at: u64) -> bool {
        let max_echoes = usize::from(self.max_echoes);
        if at < self.fired || at > self.until || self.echoes.len() >= max_echoes {
            return false;
        }
        let after = u32::try_from(at - self.fired).unwrap_or(u32::MAX);
        self.echoes.push(after).is_ok() && self.echoes.len() < max_echoes
    }
}
