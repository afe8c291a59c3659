//! Schedule of scans: mode, requests and pauses. Pure: the caller supplies the time.

use std::{collections::VecDeque, time::Duration};

use sonard_api::config::Mode;
use sonard_model::geometry::Pose;
use sonard_records::ScanPlan;
use uuid::Uuid;

/// Maximum number of queued requests, which bounds the memory.
const MAX_REQUESTS: usize = 64;

/// Request for a number of scans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QueuedScans {
    /// Id of the request, recorded in its scans.
    pub request: Uuid,
    /// Number of scans. `None` resumes the scans of the mode; it means one scan in the on-request
    /// mode, or with an own plan or pose.
    pub scans: Option<u32>,
    /// Azimuths of these scans only, instead of the current plan.
    pub plan: Option<ScanPlan>,
    /// Pose of the ranger for these scans only, instead of the current pose.
    pub pose: Option<Pose>,
}

/// Schedule of scans: those of the mode, and the queue of requests, which take precedence.
#[derive(Debug, Clone)]
pub struct Schedule {
    mode: Mode,
    every: Duration,
    /// Queued requests, each with the number of scans that have not begun.
    queue: VecDeque<(QueuedScans, u32)>,
    /// The scans of the mode are paused until the next start. A change of mode keeps the pause.
    paused: bool,
    /// Due time of the next scan in the schedule mode.
    due: Duration,
}

/// Due time of the next scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Due {
    /// A scan is due immediately.
    Now,
    /// A scan is due at this time, on the clock of the daemon.
    At(Duration),
    /// No scan is due before the next request.
    OnRequest,
}

impl Schedule {
    /// Creates a schedule without requests, whose first scheduled scan is due at `now`.
    #[must_use]
    pub const fn new(mode: Mode, every: Duration, now: Duration) -> Self {
        Self { mode, every, queue: VecDeque::new(), paused: false, due: now }
    }

    /// Changes mode and interval. Requests and a pause are kept.
    pub fn set_mode(&mut self, mode: Mode, every: Duration, now: Duration) {
        if (mode, every) != (self.mode, self.every) {
            (self.mode, self.every, self.due) = (mode, every, now);
        }
    }

    /// Queues a request, or resumes the scans of the mode if it has no number of scans. Returns
    /// `false` if the queue is full.
    pub fn start(&mut self, request: QueuedScans) -> bool {
        let is_special = request.plan.is_some() || request.pose.is_some();
        let default_scans = u32::from(self.mode == Mode::OnRequest || is_special);
        let scans = request.scans.unwrap_or(default_scans);
        if scans > 0 {
            if self.queue.len() >= MAX_REQUESTS {
                return false;
            }
            self.queue.push_back((request, scans));
        }
        self.paused &= request.scans.is_some() || is_special;
        true
    }

    /// Clears the queue, and pauses the scans of the mode until the next start. The on-request mode
    /// has no scans to pause.
    pub fn stop(&mut self) {
        self.queue.clear();
        self.paused |= self.mode != Mode::OnRequest;
    }

    /// Removes a request from the queue. Returns `true` if it was queued.
    pub fn cancel(&mut self, request: Uuid) -> bool {
        let before = self.queue.len();
        self.queue.retain(|(queued, _)| queued.request != request);
        self.queue.len() < before
    }

    /// Request of the next scan; `None` if it is a scan of the mode.
    #[must_use]
    pub fn next(&self) -> Option<QueuedScans> {
        self.queue.front().map(|(request, _)| *request)
    }

    /// Returns `true` if the scans of the mode are paused, also while the mode has none.
    #[must_use]
    pub const fn is_paused(&self) -> bool {
        self.paused
    }

    /// Number of requested scans that have not begun.
    #[must_use]
    pub fn requested(&self) -> u32 {
        self.queue.iter().fold(0, |sum, (_, scans)| sum.saturating_add(*scans))
    }

    /// Due time of the next scan.
    #[must_use]
    pub fn due(&self, now: Duration) -> Due {
        match self.mode {
            _ if !self.queue.is_empty() => Due::Now,
            _ if self.paused => Due::OnRequest,
            Mode::OnRequest => Due::OnRequest,
            Mode::Continuous => Due::Now,
            Mode::Schedule if self.due <= now => Due::Now,
            Mode::Schedule => Due::At(self.due),
        }
    }

    /// Records that a scan begins: takes it from the queue, or advances the schedule.
    pub fn begun(&mut self, now: Duration) {
        if let Some((_, left)) = self.queue.front_mut() {
            *left -= 1;
            if *left == 0 {
                self.queue.pop_front();
            }
        } else if self.mode == Mode::Schedule {
            // Missed slots are skipped, and later ones stay on the same grid.
            let behind = now.saturating_sub(self.due).as_nanos();
            let slots = behind / self.every.as_nanos().max(1) + 1;
            let slots = u32::try_from(slots).unwrap_or(u32::MAX);
            self.due = self.due.saturating_add(self.every.saturating_mul(slots));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(s: u64) -> Duration {
        Duration::from_secs(s)
    }

    fn request(scans: Option<u32>) -> QueuedScans {
        QueuedScans { request: Uuid::from_u128(7), scans, plan: None, pose: None }
    }

    #[test]
    fn schedule_skips_missed_slots() {
        let mut schedule = Schedule::new(Mode::Schedule, s(60), s(5));
        assert_eq!(schedule.due(s(5)), Due::Now);
        schedule.begun(s(5));
        assert_eq!(schedule.due(s(6)), Due::At(s(65)));
        // After an absence of the device: one scan immediately, then on the same grid.
        assert_eq!(schedule.due(s(200)), Due::Now);
        schedule.begun(s(200));
        assert_eq!(schedule.due(s(200)), Due::At(s(245)));
    }

    #[test]
    fn requests_precede_the_schedule() {
        let mut schedule = Schedule::new(Mode::Schedule, s(60), s(0));
        schedule.begun(s(0));
        assert!(schedule.start(request(Some(2))));
        assert_eq!(schedule.due(s(1)), Due::Now);
        schedule.begun(s(1));
        schedule.begun(s(2));
        assert_eq!(schedule.due(s(3)), Due::At(s(60)));
    }

    #[test]
    fn stop_pauses_until_start() {
        let mut schedule = Schedule::new(Mode::Continuous, s(60), s(0));
        assert_eq!(schedule.due(s(0)), Due::Now);
        schedule.stop();
        assert_eq!(schedule.due(s(0)), Due::OnRequest);
        assert!(schedule.start(request(Some(1))));
        assert_eq!(schedule.due(s(0)), Due::Now);
        schedule.begun(s(0));
        assert_eq!(schedule.due(s(0)), Due::OnRequest, "a counted request does not end the pause");
        assert!(schedule.start(request(None)));
        schedule.begun(s(1));
        assert_eq!((schedule.due(s(1)), schedule.requested()), (Due::Now, 0));
    }

    #[test]
    fn pause_survives_a_mode_change() {
        let mut schedule = Schedule::new(Mode::OnRequest, s(60), s(0));
        schedule.stop();
        assert!(!schedule.is_paused());
        schedule.set_mode(Mode::Continuous, s(60), s(1));
        assert_eq!(schedule.due(s(1)), Due::Now, "a stop on request pauses no other mode");
        schedule.stop();
        schedule.set_mode(Mode::OnRequest, s(60), s(2));
        assert!(schedule.is_paused());
        assert!(schedule.start(request(Some(1))));
        assert_eq!(schedule.due(s(2)), Due::Now, "a pause does not affect requests");
        schedule.begun(s(2));
        schedule.set_mode(Mode::Continuous, s(60), s(3));
        assert_eq!((schedule.is_paused(), schedule.due(s(3))), (true, Due::OnRequest));
    }

    #[test]
    fn on_request_start_is_one_scan() {
        let mut schedule = Schedule::new(Mode::OnRequest, s(60), s(0));
        assert_eq!(schedule.due(s(0)), Due::OnRequest);
        assert!(schedule.start(request(None)));
        schedule.begun(s(0));
        assert_eq!(schedule.due(s(0)), Due::OnRequest);
    }

    #[test]
    fn request_with_a_plan() {
        let mut schedule = Schedule::new(Mode::Continuous, s(60), s(0));
        schedule.stop();
        let own = QueuedScans { plan: Some(ScanPlan::default()), ..request(None) };
        let other = QueuedScans { request: Uuid::from_u128(8), scans: Some(3), ..own };
        assert!(schedule.start(own) && schedule.start(other));
        assert_eq!((schedule.next(), schedule.requested()), (Some(own), 4));
        schedule.begun(s(0));
        assert_eq!((schedule.next(), schedule.due(s(1))), (Some(other), Due::Now));
        schedule.begun(s(1));
        assert!(schedule.cancel(other.request) && !schedule.cancel(other.request));
        assert_eq!(schedule.due(s(2)), Due::OnRequest, "the pause is kept");
    }

    #[test]
    fn full_queue_rejects_requests() {
        let mut schedule = Schedule::new(Mode::OnRequest, s(60), s(0));
        let queued = (0..1000).filter(|_| schedule.start(request(Some(u32::MAX)))).count();
        assert_eq!((queued, schedule.requested()), (MAX_REQUESTS, u32::MAX));
    }
}
