//! Index of a folder of logs that grows, rotates and is repaired.

use std::{fs, io::Write as _, path::Path};

use uuid::Uuid;

use super::{LOG, folder};
use crate::{LogIndex, LoggedScan, ScanSpan};

/// Lines of the fixture with scan number `n`.
fn scan(n: u128) -> String {
    LOG.replace("5a0e7f5e-3c1d-4f5b-9d57-0c7c3d0a1b2c", &Uuid::from_u128(n).to_string())
}

/// First lines of a scan, without session, end and trailing event.
fn begun(n: u128) -> String {
    scan(n).lines().skip(1).take(4).map(|line| format!("{line}\n")).collect()
}

fn append(folder: &Path, log: &str, text: &str) {
    let mut file =
        fs::OpenOptions::new().create(true).append(true).open(folder.join(log)).expect("a log");
    file.write_all(text.as_bytes()).expect("written");
}

fn ids(scans: &[LoggedScan]) -> Vec<u128> {
    scans.iter().map(|past| past.start.scan.as_u128()).collect()
}

fn readings(passage: &ScanSpan) -> usize {
    passage.lines(true).expect("readable").inspect(|line| assert!(line.is_ok())).count()
}

#[test]
fn newest_first_in_growing_logs() {
    let (folder, _) = folder();
    let folder = folder.path();
    let mut history = LogIndex::new(folder.into());
    assert_eq!(ids(&history.newest(5).expect("readable")), []);
    append(folder, "sonard-20261120T000000Z.jsonl", &(scan(1) + &scan(2)));
    append(folder, "sonard-20261121T000000Z.jsonl", &scan(3));
    append(folder, "notes.jsonl", &scan(9));
    assert_eq!(ids(&history.newest(5).expect("readable")), [3, 2, 1]);
    assert_eq!(ids(&history.newest(2).expect("readable")), [3, 2]);
    let mut before = |scan, max| {
        let listed = history.before(Uuid::from_u128(scan), max).expect("readable");
        listed.map(|scans| ids(&scans))
    };
    assert_eq!(before(3, 5), Some(vec![2, 1]));
    assert_eq!(before(3, 1), Some(vec![2]));
    assert_eq!(before(1, 5), Some(vec![]));
    assert_eq!(before(9, 5), None);
    // A running scan is listed; its incomplete last line is not.
    let begun = begun(4);
    let (whole, torn) = begun.split_at(begun.len() - 10);
    append(folder, "sonard-20261121T000000Z.jsonl", whole);
    let newest = history.newest(1).expect("readable");
    assert_eq!((ids(&newest), newest[0].end.is_none()), (vec![4], true));
    let pings = |history: &mut LogIndex, n: u128| {
        let passage = history.scan_span(Uuid::from_u128(n)).expect("readable")?;
        let view = &passage.view;
        Some((readings(&passage), view.session.is_some(), view.end.is_some()))
    };
    assert_eq!(pings(&mut history, 4), Some((2, true, false)));
    append(folder, "sonard-20261121T000000Z.jsonl", torn);
    assert_eq!(pings(&mut history, 4), Some((3, true, false)));
    assert_eq!(pings(&mut history, 1), Some((7, true, true)));
    assert_eq!(pings(&mut history, 9), None);
}

#[test]
fn removed_and_repaired_logs() {
    let (folder, _) = folder();
    let folder = folder.path();
    let (old, new) = ("sonard-20261120T000000Z.jsonl", "sonard-20261121T000000Z.jsonl");
    append(folder, old, &scan(1));
    append(folder, new, &(scan(2) + &scan(3)));
    let mut history = LogIndex::new(folder.into());
    assert_eq!(ids(&history.newest(5).expect("readable")), [3, 2, 1]);
    fs::remove_file(folder.join(old)).expect("exists");
    fs::write(folder.join(new), scan(2)).expect("written");
    assert_eq!(ids(&history.newest(5).expect("readable")), [2]);
    assert!(history.scan_span(Uuid::from_u128(3)).expect("readable").is_none());
}

#[test]
fn damaged_and_overlong_lines() {
    let (folder, _) = folder();
    let folder = folder.path();
    let noise = format!("{{\"type\":\"scan_start\",\n{}\n\n", "x".repeat(3 << 20));
    append(folder, "sonard-20261121T000000Z.jsonl", &(scan(1) + &noise + &scan(2)));
    let mut history = LogIndex::new(folder.into());
    assert_eq!(ids(&history.newest(5).expect("readable")), [2, 1]);
    let passage = history.scan_span(Uuid::from_u128(2)).expect("readable").expect("exists");
    assert_eq!(readings(&passage), 7);
    // Readings and other lines together are complete.
    let others = passage.lines(false).expect("readable").count();
    assert_eq!(others + 7, scan(2).lines().count() - 2, "without session and trailing event");
    let (ping, highest) = passage.beam(3).expect("readable");
    assert_eq!((ping.map(|ping| ping.index), highest), (Some(3), Some(6)));
    assert_eq!(passage.beam(7).expect("readable"), (None, Some(6)));
}
