//! Readings of a log's scans, in any order of requests.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use uuid::Uuid;

use crate::{
    scan::{Ping, ScanView},
    store::{StoreError, open_for_reading, read_log},
};

/// Reader that advances until the requested scan has ended; earlier scans are buffered.
pub(super) struct Readings {
    scans: Box<dyn Iterator<Item = ScanView>>,
    buffered: HashMap<Uuid, Vec<Ping>>,
}

impl Readings {
    pub(super) fn open(log: &Path) -> Result<Self, StoreError> {
        let log = PathBuf::from(log);
        // Damaged lines were reported in the first pass.
        let records = read_log(open_for_reading(&log)?)
            .map_while(Result::ok)
            .filter_map(|line| line.record.ok());
        Ok(Self { scans: Box::new(ScanView::stream(records)), buffered: HashMap::new() })
    }

    /// Returns the readings of a scan, in the order of the log.
    pub(super) fn take(&mut self, scan: Uuid) -> Vec<Ping> {
        let found = self.buffered.remove(&scan);
        if let Some(pings) = found {
            return pings;
        }
        for view in self.scans.by_ref() {
            if view.scan == scan {
                return view.pings;
            }
            self.buffered.entry(view.scan).or_default().extend(view.pings);
        }
        Vec::new()
    }
}
