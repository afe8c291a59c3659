//! Exponential backoff of connection attempts.

use std::time::Duration;

/// Delay after the first failure.
const MIN_DELAY: Duration = Duration::from_millis(500);
/// Upper limit of the delay.
const MAX_DELAY: Duration = Duration::from_secs(30);

/// Delay before the next attempt, with jitter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Backoff(sonard_runtime::backoff::Backoff);

impl Backoff {
    pub(super) const fn new() -> Self {
        Self(sonard_runtime::backoff::Backoff::new(MIN_DELAY, MAX_DELAY))
    }

    /// Returns the next delay. `jitter` (0 to 1) shortens it by up to a half, so that the robots of
    /// a fleet do not reconnect simultaneously.
    pub(super) fn next(&mut self, jitter: f64) -> Duration {
        self.0.next_wait().mul_f64(1.0 - 0.5 * jitter.clamp(0.0, 1.0))
    }

    /// Resets the delay after a successful connection.
    pub(super) const fn reset(&mut self) {
        self.0.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubles_up_to_the_limit() {
        let mut backoff = Backoff::new();
        let delays: Vec<u128> = (0..9).map(|_| backoff.next(0.0).as_millis()).collect();
        assert_eq!(delays, [500, 1000, 2000, 4000, 8000, 16_000, 30_000, 30_000, 30_000]);
        assert_eq!(backoff.next(1.0), MAX_DELAY / 2);
        backoff.reset();
        assert_eq!(backoff.next(2.0), MIN_DELAY / 2);
    }
}
