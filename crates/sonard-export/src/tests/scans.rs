//! Scans to export.

use sonard_records::{Record, ScanView, decode_line};

/// A measured scan with predictions.
const SMALL: &str = include_str!("../../../../tests/fixtures/small.jsonl");

fn records(log: &str) -> impl Iterator<Item = Record> {
    log.lines().filter_map(|line| decode_line(line.as_bytes()).ok())
}

/// The scans of a measured log with predictions.
pub(super) fn measured() -> Vec<ScanView> {
    ScanView::from_records(records(SMALL))
}

/// The same without sessions, and without the start of the scan.
pub(super) fn bare() -> Vec<ScanView> {
    let kept = |record: &Record| !matches!(record, Record::Session(_) | Record::ScanStart(_));
    ScanView::from_records(records(SMALL).filter(kept))
}
