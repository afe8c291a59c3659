//! Scans of logs as sweeps, for verbs that interpret them.

use std::path::PathBuf;

use super::{
    Failure,
    logs::{for_each_scan, logs_in},
};
use crate::{interpret::Sweep, scan::ScanView};

/// Passes each interpretable scan of the logs to `take` as it is read, so that long collections
/// need not be in memory. Reports skipped scans.
pub(super) fn for_each_sweep(
    logs: &[PathBuf],
    mut take: impl FnMut(ScanView, Sweep),
) -> Result<(), Failure> {
    for log in &logs_in(logs)? {
        for_each_scan(log, |scan| {
            match Sweep::from_scan(&scan) {
                Ok(sweep) => take(scan, sweep),
                Err(error) => {
                    let log = log.display();
                    notice!("{log}: scan {} skipped: {error}", scan.scan);
                }
            }
            Ok(())
        })?;
    }
    Ok(())
}
