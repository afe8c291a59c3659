//! When the next scan is due. Pure: the time is given.

use std::time::Duration;

use crate::config::Mode;

/// What is to be scanned when.
#[derive(Debug, Clone)]
pub struct Agenda {
    mode: Mode,
    every: Duration,
    /// Scans asked for and not yet begun.
    requested: u32,
    /// Whether the mode's own scans are held until the next start.
    paused: bool,
    /// When the schedule's next scan is due.
    due: Duration,
}

/// When the next scan is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Due {
    /// Now.
    Now,
    /// Then.
    At(Duration),
    /// When somebody asks for one.
    OnRequest,
}

impl Agenda {
    /// An agenda whose schedule begins at once.
    #[must_use]
    pub const fn new(mode: Mode, every: Duration, now: Duration) -> Self {
        Self { mode, every, requested: 0, paused: false, due: now }
    }

    /// Another mode; what was asked for stays.
    pub fn set_mode(&mut self, mode: Mode, every: Duration, now: Duration) {
        if (mode, every) != (self.mode, self.every) {
            (self.mode, self.every, self.due) = (mode, every, now);
        }
    }

    /// Somebody asks for scans, or, without a number, for the mode's own to go on. In the mode
    /// on-request that is one scan.
    pub fn start(&mut self, scans: Option<u32>) {
        let one = u32::from(self.mode == Mode::OnRequest);
        self.requested = self.requested.saturating_add(scans.unwrap_or(one));
        self.paused &= scans.is_some();
    }

    /// Somebody wants no more scans until the next start.
    pub const fn stop(&mut self) {
        self.requested = 0;
        self.paused = true;
    }

    /// Whether somebody stopped the mode's own scans.
    #[must_use]
    pub fn is_paused(&self) -> bool {
        self.paused && self.mode != Mode::OnRequest
    }

    /// Scans asked for and not yet begun.
    #[must_use]
    pub const fn requested(&self) -> u32 {
        self.requested
    }

    /// When the next scan is due.
    #[must_use]
    pub fn due(&self, now: Duration) -> Due {
        match self.mode {
            _ if self.requested > 0 => Due::Now,
            _ if self.paused => Due::OnRequest,
            Mode::OnRequest => Due::OnRequest,
            Mode::Continuous => Due::Now,
            Mode::Schedule if self.due <= now => Due::Now,
            Mode::Schedule => Due::At(self.due),
        }
    }

    /// A scan begins.
    pub fn begun(&mut self, now: Duration) {
        if self.requested > 0 {
            self.requested -= 1;
        } else if self.mode == Mode::Schedule {
            // Turns that were missed are left out; the rhythm stays.
            let behind = now.saturating_sub(self.due).as_nanos();
            let turns = behind / self.every.as_nanos().max(1) + 1;
            let turns = u32::try_from(turns).unwrap_or(u32::MAX);
            self.due = self.due.saturating_add(self.every.saturating_mul(turns));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(s: u64) -> Duration {
        Duration::from_secs(s)
    }

    #[test]
    fn a_schedule_keeps_its_rhythm_and_leaves_out_what_it_missed() {
        let mut agenda = Agenda::new(Mode::Schedule, s(60), s(5));
        assert_eq!(agenda.due(s(5)), Due::Now);
        agenda.begun(s(5));
        assert_eq!(agenda.due(s(6)), Due::At(s(65)));
        // The device was away for a while: one scan now, then on the old beat.
        assert_eq!(agenda.due(s(200)), Due::Now);
        agenda.begun(s(200));
        assert_eq!(agenda.due(s(200)), Due::At(s(245)));
    }

    #[test]
    fn requests_come_first_and_do_not_shift_the_schedule() {
        let mut agenda = Agenda::new(Mode::Schedule, s(60), s(0));
        agenda.begun(s(0));
        agenda.start(Some(2));
        assert_eq!(agenda.due(s(1)), Due::Now);
        agenda.begun(s(1));
        agenda.begun(s(2));
        assert_eq!(agenda.due(s(3)), Due::At(s(60)));
    }

    #[test]
    fn stop_holds_until_start() {
        let mut agenda = Agenda::new(Mode::Continuous, s(60), s(0));
        assert_eq!(agenda.due(s(0)), Due::Now);
        agenda.stop();
        assert_eq!(agenda.due(s(0)), Due::OnRequest);
        agenda.start(Some(1));
        assert_eq!(agenda.due(s(0)), Due::Now);
        agenda.begun(s(0));
        assert_eq!(agenda.due(s(0)), Due::OnRequest, "a counted request does not end the hold");
        agenda.start(None);
        agenda.begun(s(1));
        assert_eq!((agenda.due(s(1)), agenda.requested()), (Due::Now, 0));
    }

    #[test]
    fn on_request_a_start_is_one_scan() {
        let mut agenda = Agenda::new(Mode::OnRequest, s(60), s(0));
        assert_eq!(agenda.due(s(0)), Due::OnRequest);
        agenda.start(None);
        agenda.begun(s(0));
        assert_eq!(agenda.due(s(0)), Due::OnRequest);
    }
}
