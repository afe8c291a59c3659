//! When the next scan is due. Pure: the time is given.

use std::{collections::VecDeque, time::Duration};

use sonard_api::config::Mode;
use sonard_model::geometry::Pose;
use sonard_records::ScanPlan;
use uuid::Uuid;

/// Requests that may wait: each costs memory.
const MOST_REQUESTS: usize = 64;

/// Scans that somebody asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asked {
    /// Identifies the request; its scans bear it.
    pub request: Uuid,
    /// So many scans; `None` for those of the mode to go on (on-request, or with a plan or a pose
    /// of its own: one scan).
    pub scans: Option<u32>,
    /// Azimuths for these scans alone, instead of those in force.
    pub plan: Option<ScanPlan>,
    /// Where the ranger stands for these scans alone, instead of the pose in force.
    pub pose: Option<Pose>,
}

/// The schedule of scans.
#[derive(Debug, Clone)]
pub struct Agenda {
    mode: Mode,
    every: Duration,
    /// Scans asked for and not yet begun: how many of each request.
    asked: VecDeque<(Asked, u32)>,
    /// Whether the mode's own scans are held until the next start; kept through changes of the mode.
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
        Self { mode, every, asked: VecDeque::new(), paused: false, due: now }
    }

    /// Another mode; what was asked for stays, and so does a hold.
    pub fn set_mode(&mut self, mode: Mode, every: Duration, now: Duration) {
        if (mode, every) != (self.mode, self.every) {
            (self.mode, self.every, self.due) = (mode, every, now);
        }
    }

    /// Somebody asks for scans, or, without a number, for the mode's own to go on. Whether there
    /// was room for the request.
    pub fn start(&mut self, asked: Asked) -> bool {
        let of_its_own = asked.plan.is_some() || asked.pose.is_some();
        let one = u32::from(self.mode == Mode::OnRequest || of_its_own);
        let scans = asked.scans.unwrap_or(one);
        if scans > 0 {
            if self.asked.len() >= MOST_REQUESTS {
                return false;
            }
            self.asked.push_back((asked, scans));
        }
        self.paused &= asked.scans.is_some() || of_its_own;
        true
    }

    /// Somebody wants no more scans until the next start. On request there are none to be held.
    pub fn stop(&mut self) {
        self.asked.clear();
        self.paused |= self.mode != Mode::OnRequest;
    }

    /// Somebody wants no more scans of a request. Whether any were waiting.
    pub fn cancel(&mut self, request: Uuid) -> bool {
        let before = self.asked.len();
        self.asked.retain(|(asked, _)| asked.request != request);
        self.asked.len() < before
    }

    /// What the next scan is asked for by; `None` if it is the mode's own.
    #[must_use]
    pub fn next(&self) -> Option<Asked> {
        self.asked.front().map(|(asked, _)| *asked)
    }

    /// Whether scans of the mode's own are held: now, or as soon as the mode has any.
    #[must_use]
    pub const fn is_paused(&self) -> bool {
        self.paused
    }

    /// Scans asked for and not yet begun.
    #[must_use]
    pub fn requested(&self) -> u32 {
        self.asked.iter().fold(0, |sum, (_, scans)| sum.saturating_add(*scans))
    }

    /// When the next scan is due.
    #[must_use]
    pub fn due(&self, now: Duration) -> Due {
        match self.mode {
            _ if !self.asked.is_empty() => Due::Now,
            _ if self.paused => Due::OnRequest,
            Mode::OnRequest => Due::OnRequest,
            Mode::Continuous => Due::Now,
            Mode::Schedule if self.due <= now => Due::Now,
            Mode::Schedule => Due::At(self.due),
        }
    }

    /// A scan begins.
    pub fn begun(&mut self, now: Duration) {
        if let Some((_, left)) = self.asked.front_mut() {
            *left -= 1;
            if *left == 0 {
                self.asked.pop_front();
            }
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

    fn asked(scans: Option<u32>) -> Asked {
        Asked { request: Uuid::from_u128(7), scans, plan: None, pose: None }
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
        assert!(agenda.start(asked(Some(2))));
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
        assert!(agenda.start(asked(Some(1))));
        assert_eq!(agenda.due(s(0)), Due::Now);
        agenda.begun(s(0));
        assert_eq!(agenda.due(s(0)), Due::OnRequest, "a counted request does not end the hold");
        assert!(agenda.start(asked(None)));
        agenda.begun(s(1));
        assert_eq!((agenda.due(s(1)), agenda.requested()), (Due::Now, 0));
    }

    #[test]
    fn a_hold_outlasts_a_change_of_mode_and_on_request_there_is_nothing_to_hold() {
        let mut agenda = Agenda::new(Mode::OnRequest, s(60), s(0));
        agenda.stop();
        assert!(!agenda.is_paused());
        agenda.set_mode(Mode::Continuous, s(60), s(1));
        assert_eq!(agenda.due(s(1)), Due::Now, "who stopped a request did not stop this");
        agenda.stop();
        agenda.set_mode(Mode::OnRequest, s(60), s(2));
        assert!(agenda.is_paused());
        assert!(agenda.start(asked(Some(1))));
        assert_eq!(agenda.due(s(2)), Due::Now, "a request is served all the same");
        agenda.begun(s(2));
        agenda.set_mode(Mode::Continuous, s(60), s(3));
        assert_eq!((agenda.is_paused(), agenda.due(s(3))), (true, Due::OnRequest));
    }

    #[test]
    fn on_request_a_start_is_one_scan() {
        let mut agenda = Agenda::new(Mode::OnRequest, s(60), s(0));
        assert_eq!(agenda.due(s(0)), Due::OnRequest);
        assert!(agenda.start(asked(None)));
        agenda.begun(s(0));
        assert_eq!(agenda.due(s(0)), Due::OnRequest);
    }

    #[test]
    fn a_request_with_a_plan_of_its_own_is_one_scan_in_any_mode_and_can_be_cancelled() {
        let mut agenda = Agenda::new(Mode::Continuous, s(60), s(0));
        agenda.stop();
        let own = Asked { plan: Some(ScanPlan::default()), ..asked(None) };
        let other = Asked { request: Uuid::from_u128(8), scans: Some(3), ..own };
        assert!(agenda.start(own) && agenda.start(other));
        assert_eq!((agenda.next(), agenda.requested()), (Some(own), 4));
        agenda.begun(s(0));
        assert_eq!((agenda.next(), agenda.due(s(1))), (Some(other), Due::Now));
        agenda.begun(s(1));
        assert!(agenda.cancel(other.request) && !agenda.cancel(other.request));
        assert_eq!(agenda.due(s(2)), Due::OnRequest, "the hold stays");
    }

    #[test]
    fn requests_without_end_are_refused() {
        let mut agenda = Agenda::new(Mode::OnRequest, s(60), s(0));
        let taken = (0..1000).filter(|_| agenda.start(asked(Some(u32::MAX)))).count();
        assert_eq!((taken, agenda.requested()), (MOST_REQUESTS, u32::MAX));
    }
}
