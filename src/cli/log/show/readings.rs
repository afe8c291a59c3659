//! The readings of a log's scans, in the order in which they are asked for.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use uuid::Uuid;

use crate::{
    scan::{Ping, ScanView},
    store::{StoreError, open_for_reading, read_log},
};

/// Reads on until the scan asked for has ended; what ended before it waits for its turn.
pub(super) struct Readings {
    scans: Box<dyn Iterator<Item = ScanView>>,
    waiting: HashMap<Uuid, Vec<Ping>>,
}

impl Readings {
    /// Of the log at `log`.
    pub(super) fn of(log: &Path) -> Result<Self, StoreError> {
        let log = PathBuf::from(log);
        // Damage was told when the log was read for the first time.
        let records = read_log(open_for_reading(&log)?)
            .map_while(Result::ok)
            .filter_map(|line| line.record.ok());
        Ok(Self { scans: Box::new(ScanView::one_by_one(records)), waiting: HashMap::new() })
    }

    /// The readings of a scan, in the order of the log.
    pub(super) fn take(&mut self, scan: Uuid) -> Vec<Ping> {
        let known = self.waiting.remove(&scan);
        if let Some(pings) = known {
            return pings;
        }
        for view in self.scans.by_ref() {
            if view.scan == scan {
                return view.pings;
            }
            self.waiting.entry(view.scan).or_default().extend(view.pings);
        }
        Vec::new()
    }
}
