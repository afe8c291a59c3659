//! When the daemon's status is sent.

use std::time::Duration;

use bytes::Bytes;
use sonard_api::{LinkState, Status};

/// What of the status is told as soon as it changes.
type Gist = (LinkState, Option<String>, bool, Option<uuid::Uuid>, Option<String>);

/// Decides when the status is sent: at once if its gist changed, else from time to time; and never while the one
/// before is not acknowledged.
#[derive(Debug)]
pub(super) struct StatusNews {
    every: Duration,
    last: Option<(Gist, Duration)>,
    is_under_way: bool,
}

impl StatusNews {
    pub(super) const fn new(every: Duration) -> Self {
        Self { every, last: None, is_under_way: false }
    }

    /// What is sent now, if something is.
    pub(super) fn due(&mut self, status: &Status, now: Duration) -> Option<Bytes> {
        let gist = (
            status.link.state,
            status.link.trouble.clone(),
            status.scanning.paused,
            status.scan.as_ref().map(|scan| scan.scan),
            status.log.error.clone(),
        );
        let is_news = self
            .last
            .as_ref()
            .is_none_or(|(before, at)| *before != gist || now >= *at + self.every);
        if self.is_under_way || !is_news {
            return None;
        }
        self.last = Some((gist, now));
        self.is_under_way = true;
        serde_json::to_vec(status).ok().map(Bytes::from)
    }

    /// The broker has it.
    pub(super) const fn acknowledged(&mut self) {
        self.is_under_way = false;
    }
}
