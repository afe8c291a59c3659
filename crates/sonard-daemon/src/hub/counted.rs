//! How many listen to the hub, and to what.

use std::sync::atomic::Ordering;

use super::{Hub, held};

/// A subscriber who listens elsewhere; dropping it says that it left.
#[derive(Debug)]
pub struct Attendance {
    _counted: Counted,
}

impl Attendance {
    pub(super) fn new(hub: &Hub) -> Self {
        let counts = Counts { subscribers: 1, ..Counts::default() };
        Self { _counted: Counted::new(hub, counts) }
    }
}

/// What somebody who listens counts as.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counts {
    pub(super) subscribers: usize,
    pub(super) of_records: usize,
    pub(super) of_verdicts: usize,
}

/// Counts somebody as long as it is there.
#[derive(Debug)]
pub(super) struct Counted {
    hub: Hub,
    counts: Counts,
}

impl Counted {
    pub(super) fn new(hub: &Hub, counts: Counts) -> Self {
        hub.inner.subscribers.fetch_add(counts.subscribers, Ordering::Relaxed);
        hub.inner.of_records.fetch_add(counts.of_records, Ordering::Relaxed);
        hub.inner.of_verdicts.fetch_add(counts.of_verdicts, Ordering::Relaxed);
        Self { hub: hub.clone(), counts }
    }

    pub(super) const fn hub(&self) -> &Hub {
        &self.hub
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        let (inner, counts) = (&self.hub.inner, self.counts);
        inner.subscribers.fetch_sub(counts.subscribers, Ordering::Relaxed);
        inner.of_verdicts.fetch_sub(counts.of_verdicts, Ordering::Relaxed);
        let last = inner.of_records.fetch_sub(counts.of_records, Ordering::Relaxed) == 1;
        if counts.of_records > 0 && last {
            // Nobody is left who wants them. Who comes at this moment misses nothing but these.
            let mut waiting = held(&inner.waiting);
            waiting.readings.clear();
            waiting.controls.clear();
        }
    }
}
