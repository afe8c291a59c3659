//! The computer's wall clock, watched for being set.

use std::{
    thread,
    time::{Duration, Instant},
};

use jiff::{SignedDuration, Timestamp};

/// A wall clock that moved by more than this against the one that never jumps was set.
const STEP: SignedDuration = SignedDuration::from_millis(100);

/// By how much the wall clock was set, if that is more than clocks drift apart.
pub(super) fn as_step(moved: SignedDuration) -> Option<SignedDuration> {
    (moved.abs() > STEP).then_some(moved)
}

/// By how much the wall clock was set, if several looks agree on that: two clocks can't be read at
/// the same moment, and who is interrupted in between sees a step that was none.
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

/// Tells when the wall clock is set, by the clock that never jumps.
#[derive(Debug)]
pub(super) struct WallClock {
    began: Instant,
    at: Timestamp,
    /// What was told already.
    told: SignedDuration,
    steps: u32,
}

impl WallClock {
    pub(super) fn new() -> Self {
        let (began, at) = (Instant::now(), Timestamp::now());
        Self { began, at, told: SignedDuration::ZERO, steps: 0 }
    }

    /// By how much it was set since it was asked last.
    pub(super) fn step(&mut self) -> Option<SignedDuration> {
        let (began, at, told) = (self.began, self.at, self.told);
        let step = confirmed(|| moved(at, Timestamp::now(), began.elapsed()) - told)?;
        self.tell(step);
        Some(step)
    }

    fn tell(&mut self, step: SignedDuration) {
        self.told += step;
        self.steps += 1;
    }

    /// By how much it was set in all, and in how many steps.
    pub(super) const fn told(&self) -> (SignedDuration, u32) {
        (self.told, self.steps)
    }
}

/// By how much more than the time that passed a wall clock went on from `at` to `now`.
fn moved(at: Timestamp, now: Timestamp, elapsed: Duration) -> SignedDuration {
    now.duration_since(at) - SignedDuration::try_from(elapsed).unwrap_or(SignedDuration::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_what_is_more_than_drift() {
        let start: Timestamp = "2026-03-01T10:00:00Z".parse().expect("a time");
        let step = |elapsed_s: u64, set_ms: i64| {
            let elapsed = Duration::from_secs(elapsed_s);
            let now = start + elapsed + SignedDuration::from_millis(set_ms);
            as_step(moved(start, now, elapsed)).map(|step| step.as_millis())
        };
        assert_eq!(step(1, 0), None);
        assert_eq!(step(2, 99), None);
        assert_eq!(step(3, 3_600_000), Some(3_600_000));
        assert_eq!(step(5, -2_000), Some(-2_000));
    }

    #[test]
    fn each_step_is_told_once_and_only_when_several_looks_agree() {
        let mut clock = WallClock::new();
        assert_eq!(clock.step(), None, "nobody set it");
        clock.at -= SignedDuration::from_secs(60);
        let step = clock.step().expect("it was set").as_secs_f64();
        assert!((step - 60.0).abs() < 0.1, "{step}");
        assert_eq!(clock.step(), None);
        assert_eq!(clock.told().1, 1);
        let seconds = SignedDuration::from_secs;
        let mut looks = [3600, 0, 3600].into_iter().map(seconds);
        assert_eq!(confirmed(|| looks.next().expect("no further look")), None);
        assert_eq!(confirmed(|| seconds(3600)), Some(seconds(3600)));
    }
}
