//! When the next ranger fires: on a grid of equal intervals, whatever happens in between.

use std::time::Duration;

use tokio::time::Instant;

/// A grid of equal intervals.
#[derive(Debug)]
pub(super) struct Rhythm {
    next: Instant,
    skipped: u64,
}

impl Rhythm {
    pub(super) const fn new(now: Instant) -> Self {
        Self { next: now, skipped: 0 }
    }

    /// When the next ranger fires.
    pub(super) const fn next(&self) -> Instant {
        self.next
    }

    /// After a rest the grid begins anew.
    pub(super) fn resume(&mut self, now: Instant) {
        self.next = self.next.max(now);
    }

    /// A ranger has fired. Turns that are missed are left out and counted, never made up for; one
    /// that is late by up to half an interval is taken late.
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

    /// Turns that were left out since the start, because the model was not ready.
    pub(super) const fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_stay_on_the_grid_and_missed_ones_are_counted() {
        let (start, interval) = (Instant::now(), Duration::from_millis(40));
        let at = |ms| start + Duration::from_millis(ms);
        let mut rhythm = Rhythm::new(start);
        rhythm.advance(at(39), interval);
        assert_eq!((rhythm.next(), rhythm.skipped()), (at(40), 0));
        // A reading was told 2 ms late: the next ranger fires at once, and the grid stays.
        let mut late = Rhythm::new(start);
        late.advance(at(42), interval);
        assert_eq!((late.next(), late.skipped()), (at(40), 0));
        // The model took until 130: the turns at 80 and 120 are gone.
        rhythm.advance(at(130), interval);
        assert_eq!((rhythm.next(), rhythm.skipped()), (at(160), 2));
        rhythm.resume(at(100));
        assert_eq!(rhythm.next(), at(160), "no rest, no new grid");
        rhythm.resume(at(1000));
        assert_eq!(rhythm.next(), at(1000));
    }
}
