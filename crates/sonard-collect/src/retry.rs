//! Growing retry delays with an overall time limit.

use std::time::Duration;

use sonard_runtime::backoff::Backoff;
use tokio::time::Instant;

/// Delays between attempts to use a ranger, up to a deadline.
#[derive(Debug)]
pub struct RetrySchedule {
    until: Instant,
    backoff: Backoff,
}

impl RetrySchedule {
    /// Creates delays for a ranger that does not respond: 0.3 s to 10 s, because an attempt is
    /// cheap.
    #[must_use]
    pub fn for_absent_device(patience: Duration) -> Self {
        Self::new(patience, Backoff::new(Duration::from_millis(300), Duration::from_secs(10)))
    }

    /// Creates delays for a ranger that responds and then loses its scans: 1 s to 300 s with
    /// factor 4, because an attempt costs a scan.
    #[must_use]
    pub fn for_lost_scans(patience: Duration) -> Self {
        let backoff = Backoff::new(Duration::from_secs(1), Duration::from_secs(300));
        Self::new(patience, backoff.with_factor(4))
    }

    fn new(patience: Duration, backoff: Backoff) -> Self {
        Self { until: Instant::now() + patience, backoff }
    }

    /// Returns the delay before the next attempt; `None` if it would end after the deadline.
    pub fn next_delay(&mut self) -> Option<Duration> {
        let wait = self.backoff.next_wait();
        (Instant::now() + wait < self.until).then_some(wait)
    }
}
