//! Waits between tries, which grow until patience is over.

use std::time::Duration;

use tokio::time::Instant;

/// Waits between tries to get something of a ranger.
#[derive(Debug)]
pub struct Patience {
    until: Instant,
    wait: Duration,
    factor: u32,
    max: Duration,
}

impl Patience {
    /// For finding a ranger that does not answer: a try costs nothing.
    #[must_use]
    pub fn with_absence(patience: Duration) -> Self {
        Self::new(patience, Duration::from_millis(300), 2, Duration::from_secs(10))
    }

    /// For a ranger that answers and loses one scan after the other: a try costs a scan.
    #[must_use]
    pub fn with_losses(patience: Duration) -> Self {
        Self::new(patience, Duration::from_secs(1), 4, Duration::from_secs(300))
    }

    fn new(patience: Duration, wait: Duration, factor: u32, max: Duration) -> Self {
        Self { until: Instant::now() + patience, wait, factor, max }
    }

    /// How long to wait before the next try; `None` when there is to be no other.
    pub fn next_wait(&mut self) -> Option<Duration> {
        let wait = self.wait;
        self.wait = (wait * self.factor).min(self.max);
        (Instant::now() + wait < self.until).then_some(wait)
    }
}
