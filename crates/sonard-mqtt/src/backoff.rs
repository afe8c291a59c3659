//! How long is waited from try to try to reach the broker.

use std::time::Duration;

/// After the first failure.
const LEAST: Duration = Duration::from_millis(500);
/// Never longer.
const MOST: Duration = Duration::from_secs(30);

/// The wait, which doubles from try to try.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patience(Duration);

impl Patience {
    pub(super) const fn new() -> Self {
        Self(LEAST)
    }

    /// The next wait. `chance` (0 to 1) shortens it by up to a half, so that the robots of a fleet do not all come
    /// back at once.
    pub(super) fn next(&mut self, chance: f64) -> Duration {
        let wait = self.0.mul_f64(1.0 - 0.5 * chance.clamp(0.0, 1.0));
        self.0 = (self.0 * 2).min(MOST);
        wait
    }

    /// The broker is there and does its part.
    pub(super) const fn restore(&mut self) {
        self.0 = LEAST;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_a_bound_and_are_never_close_to_none() {
        let mut patience = Patience::new();
        let waits: Vec<u128> = (0..9).map(|_| patience.next(0.0).as_millis()).collect();
        assert_eq!(waits, [500, 1000, 2000, 4000, 8000, 16_000, 30_000, 30_000, 30_000]);
        assert_eq!(patience.next(1.0), MOST / 2);
        patience.restore();
        assert_eq!(patience.next(2.0), LEAST / 2);
    }
}
