//! Publication schedule of the daemon's status.

use std::time::Duration;

use bytes::Bytes;
use sonard_api::{LinkState, Status};

/// Part of the status that is published immediately on change.
type StatusKey = (LinkState, Option<String>, bool, Option<uuid::Uuid>, Option<String>);

/// Publication schedule: immediately after an important change, otherwise periodically, and never
/// before the previous status is acknowledged.
#[derive(Debug)]
pub(super) struct StatusSchedule {
    interval: Duration,
    last: Option<(StatusKey, Duration)>,
    is_in_flight: bool,
}

impl StatusSchedule {
    pub(super) const fn new(interval: Duration) -> Self {
        Self { interval, last: None, is_in_flight: false }
    }

    /// Returns the serialized status if it is due.
    pub(super) fn due(&mut self, status: &Status, now: Duration) -> Option<Bytes> {
        let key = (
            status.link.state,
            status.link.error.clone(),
            status.scanning.paused,
            status.scan.as_ref().map(|scan| scan.scan),
            status.log.error.clone(),
        );
        let is_due = self
            .last
            .as_ref()
            .is_none_or(|(before, at)| *before != key || now >= *at + self.interval);
        if self.is_in_flight || !is_due {
            return None;
        }
        self.last = Some((key, now));
        self.is_in_flight = true;
        serde_json::to_vec(status).ok().map(Bytes::from)
    }

    /// Notes the broker's acknowledgement.
    pub(super) const fn acknowledged(&mut self) {
        self.is_in_flight = false;
    }
}
