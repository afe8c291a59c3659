//! Waits between tries, which grow until patience is over.

use std::time::Duration;

use sonard_runtime::backoff::Backoff;
use tokio::time::Instant;

/// Waits between tries to get something of a ranger.
#[derive(Debug)]
pub struct Patience {
    until: Instant,
    backoff: Backoff,
}

impl Patience {
    /// For finding a ranger that does not answer: a try costs nothing.
    #[must_use]
    pub fn with_absence(patience: Duration) -> Self {
        Self::new(patience, Backoff::new(Duration::from_millis(300), Duration::from_secs(10)))
    }

    /// For a ranger that answers and loses one scan after the other: a try costs a scan.
    #[must_use]
    pub fn with_losses(patience: Duration) -> Self {
        let backoff = Backoff::new(Duration::from_secs(1), Duration::from_secs(300));
        Self::new(patience, backoff.with_factor(4))
    }

    fn new(patience: Duration, backoff: Backoff) -> Self {
        Self { until: Instant::now() + patience, backoff }
    }

    /// How long to wait before the next try; `None` when there is to be no other.
    pub fn next_wait(&mut self) -> Option<Duration> {
        let wait = self.backoff.next_wait();
        (Instant::now() + wait < self.until).then_some(wait)
    }
}
