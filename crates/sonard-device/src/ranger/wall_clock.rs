//! Detection of steps of the computer's wall clock.

use std::{
    thread,
    time::{Duration, Instant},
};

use jiff::{SignedDuration, Timestamp};

/// Deviation between wall clock and monotonic clock above which the wall clock was set.
const MIN_STEP: SignedDuration = SignedDuration::from_millis(100);

/// Returns a deviation of the wall clock if it is larger than clock drift explains.
pub(super) fn as_step(moved: SignedDuration) -> Option<SignedDuration> {
    (moved.abs() > MIN_STEP).then_some(moved)
}

/// Returns the step of the wall clock if several measurements agree. The two clocks can't be read
/// simultaneously: an interruption between the readings looks like a step.
pub(super) fn confirmed(mut moved: impl FnMut() -> SignedDuration) -> Option<SignedDuration> {
    let step = as_step(moved())?;
    for _ in 0..2 {
        thread::sleep(Duration::from_millis(1));
        if as_step(moved() - step).is_some() {
            return None;
        }
    }
    Some(step)
}

/// Detector of wall-clock steps against the monotonic clock.
#[derive(Debug)]
pub(super) struct WallClock {
    began: Instant,
    at: Timestamp,
    /// Sum of the steps reported so far.
    reported: SignedDuration,
    steps: u32,
}

impl WallClock {
    pub(super) fn new() -> Self {
        let (began, at) = (Instant::now(), Timestamp::now());
        Self { began, at, reported: SignedDuration::ZERO, steps: 0 }
    }

    /// Returns the step of the wall clock since the previous call.
    pub(super) fn step(&mut self) -> Option<SignedDuration> {
        let (began, at, reported) = (self.began, self.at, self.reported);
        let step = confirmed(|| deviation(at, Timestamp::now(), began.elapsed()) - reported)?;
        self.reported += step;
        self.steps += 1;
        Some(step)
    }

    /// Sum and number of all steps so far.
    pub(super) const fn total_step(&self) -> (SignedDuration, u32) {
        (self.reported, self.steps)
    }
}

/// Advance of the wall clock from `at` to `now` in excess of the elapsed time.
fn deviation(at: Timestamp, now: Timestamp, elapsed: Duration) -> SignedDuration {
    now.duration_since(at) - SignedDuration::try_from(elapsed).unwrap_or(SignedDuration::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drift_is_no_step() {
        let start: Timestamp = "2026-03-01T10:00:00Z".parse().expect("a time");
        let step = |elapsed_s: u64, set_ms: i64| {
            let elapsed = Duration::from_secs(elapsed_s);
            let now = start + elapsed + SignedDuration::from_millis(set_ms);
            as_step(deviation(start, now, elapsed)).map(|step| step.as_millis())
        };
        assert_eq!(step(1, 0), None);
        assert_eq!(step(2, 99), None);
        assert_eq!(step(3, 3_600_000), Some(3_600_000));
        assert_eq!(step(5, -2_000), Some(-2_000));
    }

    #[test]
    fn step_is_confirmed_and_reported_once() {
        let mut clock = WallClock::new();
        assert_eq!(clock.step(), None, "not set");
        clock.at -= SignedDuration::from_secs(60);
        let step = clock.step().expect("it was set").as_secs_f64();
        assert!((step - 60.0).abs() < 0.1, "{step}");
        assert_eq!(clock.step(), None);
        assert_eq!(clock.total_step().1, 1);
        let seconds = SignedDuration::from_secs;
        let mut readings = [3600, 0, 3600].into_iter().map(seconds);
        assert_eq!(confirmed(|| readings.next().expect("no further reading")), None);
        assert_eq!(confirmed(|| seconds(3600)), Some(seconds(3600)));
    }
}
