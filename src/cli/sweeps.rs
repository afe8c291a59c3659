//! Scans of logs as sweeps, for the verbs that make sense of them.

use std::path::{Path, PathBuf};

use super::{Failure, picture::warn_of_damage, progress};
use crate::{
    interpret::Sweep,
    scan::ScanView,
    store::{StoreError, open_for_reading, read_log},
};

/// Hands over each scan of the logs that can be interpreted, one by one as it is read, since a
/// collection of days need not be in memory at once. Says which scans are left out.
pub(super) fn for_each_sweep(
    logs: &[PathBuf],
    mut take: impl FnMut(ScanView, Sweep),
) -> Result<(), Failure> {
    for log in logs {
        let sweeps = each_scan(log, |scan| match Sweep::of(&scan) {
            Ok(sweep) => take(scan, sweep),
            Err(error) => {
                let log = log.display();
                anstream::eprintln!("{log}: scan {} is left out: {error}", scan.scan);
            }
        });
        sweeps.map_err(|error| Failure::input(&error, error.help()))?;
    }
    Ok(())
}

fn each_scan(log: &Path, take: impl FnMut(ScanView)) -> Result<(), StoreError> {
    let (mut damaged, mut broken) = (Vec::new(), None);
    let records = read_log(progress::reading(log, open_for_reading(log)?))
        .map_while(|line| line.map_err(|source| broken = Some(source)).ok())
        .filter_map(|line| line.record.map_err(|error| damaged.push(error)).ok());
    ScanView::one_by_one(records).for_each(take);
    warn_of_damage(log, &damaged);
    broken.map_or(Ok(()), |source| Err(StoreError::Read { path: log.into(), source }))
}
