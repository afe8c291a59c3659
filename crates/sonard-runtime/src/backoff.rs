//! Exponential back-off between attempts.

use std::time::Duration;

/// Wait between attempts, multiplied by a factor after each up to a maximum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Backoff {
    min: Duration,
    max: Duration,
    factor: u32,
    wait: Duration,
}

impl Backoff {
    /// Doubles from `min` up to `max`.
    #[must_use]
    pub const fn new(min: Duration, max: Duration) -> Self {
        Self { min, max, factor: 2, wait: min }
    }

    /// Multiplies by another factor.
    #[must_use]
    pub const fn with_factor(self, factor: u32) -> Self {
        Self { factor, ..self }
    }

    /// Wait before the next attempt.
    pub fn next_wait(&mut self) -> Duration {
        let wait = self.wait;
        self.wait = wait.saturating_mul(self.factor).min(self.max);
        wait
    }

    /// Starts again with the minimum, after a success.
    pub const fn reset(&mut self) {
        self.wait = self.min;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubles_up_to_the_maximum() {
        let mut backoff = Backoff::new(Duration::from_millis(500), Duration::from_secs(3));
        let waits: Vec<u128> = (0..5).map(|_| backoff.next_wait().as_millis()).collect();
        assert_eq!(waits, [500, 1000, 2000, 3000, 3000]);
        backoff.reset();
        assert_eq!(backoff.next_wait(), Duration::from_millis(500));
        let mut fourfold = backoff.with_factor(4);
        fourfold.reset();
        assert_eq!(
            [fourfold.next_wait(), fourfold.next_wait()].map(|wait| wait.as_millis()),
            [500, 2000]
        );
    }

    #[test]
    fn never_overflows() {
        let mut backoff = Backoff::new(Duration::MAX / 2, Duration::MAX).with_factor(u32::MAX);
        backoff.next_wait();
        assert_eq!(backoff.next_wait(), Duration::MAX);
    }
}
