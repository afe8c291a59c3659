//! Where records and news go: log, subscribers, status.

use std::sync::Arc;

use jiff::Timestamp;

use super::{hub::Hub, journal::Journal, status::Shared};
use crate::{
    ranger::Sink,
    scan::{Event, EventKind, Record},
    store::StoreError,
};

/// Where records and news go.
#[derive(Clone)]
pub(super) struct Outlet {
    pub(super) journal: Journal,
    pub(super) hub: Hub,
    pub(super) shared: Arc<Shared>,
}

impl Outlet {
    /// An event, now.
    pub(super) fn event(&self, kind: EventKind, detail: String) {
        self.put(&Record::Event(Event { time: Timestamp::now(), kind, detail }));
    }

    /// A record for everybody.
    pub(super) fn put(&self, record: &Record) {
        if let Record::Session(session) = record {
            let session = Arc::new((**session).clone());
            self.shared.view.send_modify(|view| view.session = Some(session));
        }
        let over = self.shared.collect(record);
        self.journal.record(record);
        self.hub.publish(record);
        if let Some(scan) = over {
            self.hub.publish_scan(&scan);
        }
    }
}

impl Sink for Outlet {
    fn record(&mut self, record: &Record) -> Result<(), StoreError> {
        if let Record::ScanStart(start) = record {
            let begun = (start.scan, start.plan.beams());
            self.shared.view.send_modify(|view| view.scan = Some(begun));
        }
        self.put(record);
        Ok(())
    }
}
