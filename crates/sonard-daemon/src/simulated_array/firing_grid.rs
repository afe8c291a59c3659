//! Firing times of the rangers, on a grid of equal intervals.

use std::time::Duration;

use tokio::time::Instant;

/// Grid of firing slots at equal intervals.
#[derive(Debug)]
pub(super) struct FiringGrid {
    next: Instant,
    skipped: u64,
}

impl FiringGrid {
    pub(super) const fn new(now: Instant) -> Self {
        Self { next: now, skipped: 0 }
    }

    /// Time of the next slot.
    pub(super) const fn next(&self) -> Instant {
        self.next
    }

    /// Starts a new grid at `now`, unless the next slot is later.
    pub(super) fn resume(&mut self, now: Instant) {
        self.next = self.next.max(now);
    }

    /// Advances to the next slot after a firing. Missed slots are skipped and counted; a slot that
    /// is late by up to half an interval is used late.
    pub(super) fn advance(&mut self, now: Instant, interval: Duration) {
        self.next += interval;
        let behind = now.saturating_duration_since(self.next).as_nanos();
        let missed = match interval.as_nanos().max(1) {
            each if behind * 2 <= each => 0,
            each => behind.div_ceil(each),
        };
        self.skipped += missed as u64;
        self.next += interval.saturating_mul(u32::try_from(missed).unwrap_or(u32::MAX));
    }

    /// Number of slots skipped since the start, because the model was too slow.
    pub(super) const fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missed_slots_are_counted() {
        let (start, interval) = (Instant::now(), Duration::from_millis(40));
        let at = |ms| start + Duration::from_millis(ms);
        let mut firing_grid = FiringGrid::new(start);
        firing_grid.advance(at(39), interval);
        assert_eq!((firing_grid.next(), firing_grid.skipped()), (at(40), 0));
        // A reading was published 2 ms late: the next ranger fires immediately, on the same grid.
        let mut late = FiringGrid::new(start);
        late.advance(at(42), interval);
        assert_eq!((late.next(), late.skipped()), (at(40), 0));
        // The model took until 130 ms: the slots at 80 and 120 ms are skipped.
        firing_grid.advance(at(130), interval);
        assert_eq!((firing_grid.next(), firing_grid.skipped()), (at(160), 2));
        firing_grid.resume(at(100));
        assert_eq!(firing_grid.next(), at(160), "no new grid before the next slot");
        firing_grid.resume(at(1000));
        assert_eq!(firing_grid.next(), at(1000));
    }
}
