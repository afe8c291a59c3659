//! Scans of logs as sweeps, for the verbs that make sense of them.

use std::path::PathBuf;

use super::{
    Failure,
    logs::{for_each_scan, logs_in},
};
use crate::{interpret::Sweep, scan::ScanView};

/// Hands over each scan of the logs that can be interpreted, one by one as it is read, since a
/// collection of days need not be in memory at once. Says which scans are left out.
pub(super) fn for_each_sweep(
    logs: &[PathBuf],
    mut take: impl FnMut(ScanView, Sweep),
) -> Result<(), Failure> {
    for log in &logs_in(logs)? {
        for_each_scan(log, |scan| {
            match Sweep::of(&scan) {
                Ok(sweep) => take(scan, sweep),
                Err(error) => {
                    let log = log.display();
                    notice!("{log}: scan {} is left out: {error}", scan.scan);
                }
            }
            Ok(())
        })?;
    }
    Ok(())
}
