//! Counts of the hub's subscribers.

use std::sync::atomic::Ordering;

use super::{Hub, lock};

/// Registration of a client that is served outside the hub; dropping it removes the client.
#[derive(Debug)]
pub struct ClientGuard {
    _counted: CountGuard,
}

impl ClientGuard {
    pub(super) fn new(hub: &Hub) -> Self {
        let counts = SubscriberCounts { subscribers: 1, ..SubscriberCounts::default() };
        Self { _counted: CountGuard::new(hub, counts) }
    }
}

/// Contribution of a subscription to the counts.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SubscriberCounts {
    pub(super) subscribers: usize,
    pub(super) records: usize,
    pub(super) verdicts: usize,
}

/// Counts a subscription for its lifetime.
#[derive(Debug)]
pub(super) struct CountGuard {
    hub: Hub,
    counts: SubscriberCounts,
}

impl CountGuard {
    pub(super) fn new(hub: &Hub, counts: SubscriberCounts) -> Self {
        hub.inner.subscribers.fetch_add(counts.subscribers, Ordering::Relaxed);
        hub.inner.record_subscribers.fetch_add(counts.records, Ordering::Relaxed);
        hub.inner.verdict_subscribers.fetch_add(counts.verdicts, Ordering::Relaxed);
        Self { hub: hub.clone(), counts }
    }

    pub(super) const fn hub(&self) -> &Hub {
        &self.hub
    }
}

impl Drop for CountGuard {
    fn drop(&mut self) {
        let (inner, counts) = (&self.hub.inner, self.counts);
        inner.subscribers.fetch_sub(counts.subscribers, Ordering::Relaxed);
        inner.verdict_subscribers.fetch_sub(counts.verdicts, Ordering::Relaxed);
        let last = inner.record_subscribers.fetch_sub(counts.records, Ordering::Relaxed) == 1;
        if counts.records > 0 && last {
            // No subscriber is left to read the buffers. A concurrent new one starts behind them.
            let mut buffers = lock(&inner.buffers);
            buffers.readings.clear();
            buffers.controls.clear();
        }
    }
}
