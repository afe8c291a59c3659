//! Folder of logs: rotation at session and scan boundaries, and recovery after a crash.

use std::{fs, path::Path, time::Duration};

use jiff::Timestamp;
use sonard_records::{Record, decode_line};
use uuid::Uuid;

use crate::{LogFolder, Rotation, check_log, load, log_files, open_for_reading};

const LOG: &str = include_str!("../../../../tests/fixtures/small.jsonl");

fn rotation(max_bytes: u64) -> Rotation {
    Rotation { max_bytes, daily: true, keep_bytes: 0, sync_interval: Duration::from_secs(2) }
}

fn time(text: &str) -> Timestamp {
    text.parse().expect("a time")
}

/// Records of the fixture with scan number `n`.
fn scan(n: u128) -> Vec<Record> {
    let id = Uuid::from_u128(n);
    let with_id = |line: &str| {
        let mut record = decode_line(line.as_bytes()).expect("the fixture is clean");
        match &mut record {
            Record::ScanStart(start) => start.scan = id,
            Record::Ping(ping) => ping.scan = id,
            Record::ScanEnd(end) => end.scan = id,
            Record::Session(_) | Record::Event(_) => {}
        }
        record
    };
    LOG.lines().map(with_id).collect()
}

fn append_all(log: &mut LogFolder, records: &[Record], now: Timestamp) {
    records.iter().for_each(|record| log.append(record, now).expect("written"));
}

fn names(folder: &Path) -> Vec<String> {
    log_files(folder).expect("readable").into_iter().map(|file| file.name).collect()
}

/// Counts the problems and warnings of all logs.
fn faults(folder: &Path) -> (u64, u64) {
    let mut sum = (0, 0);
    for name in names(folder) {
        let reader = open_for_reading(&folder.join(&name)).expect("readable");
        let totals = check_log(reader, |finding| println!("{name}: {finding}")).expect("readable");
        sum = (sum.0 + totals.problems, sum.1 + totals.warnings);
    }
    sum
}

#[test]
fn session_after_failed_rotation() {
    let root = tempfile::tempdir().expect("a folder");
    let (folder, away) = (root.path().join("log"), root.path().join("away"));
    let now = time("2026-03-01T10:00:00Z");
    let mut log = LogFolder::open(&folder, rotation(1), now).expect("opens");
    append_all(&mut log, &scan(1), now);
    // Creation of the next file fails, as on a full disk.
    fs::rename(&folder, &away).expect("renamed");
    fs::write(&folder, "no folder").expect("the name is free");
    let second = scan(2);
    let tomorrow = time("2026-03-02T10:00:00Z");
    assert!(log.append(&second[1], tomorrow).is_err());
    fs::remove_file(&folder).expect("removed");
    fs::rename(&away, &folder).expect("renamed");
    append_all(&mut log, &second[1..], tomorrow);
    log.close(tomorrow).expect("syncs");
    // The event about the moved folder is later than the fixture's records.
    assert_eq!((names(&folder).len(), faults(&folder)), (2, (0, 1)));
}

#[test]
fn rotation_between_scans() {
    let folder = tempfile::tempdir().expect("a folder");
    let now = time("2026-03-01T10:00:00Z");
    let mut log = LogFolder::open(folder.path(), rotation(1), now).expect("opens");
    append_all(&mut log, &scan(1), now);
    // The next scan has no session of its own: the new file repeats the current one.
    append_all(&mut log, &scan(2)[1..], now);
    append_all(&mut log, &scan(3)[1..], now);
    log.close(now).expect("syncs");
    let names = names(folder.path());
    assert_eq!(names.len(), 3, "{names:?}");
    for name in &names {
        let loaded = load(&folder.path().join(name)).expect("readable");
        assert!(matches!(loaded.records.first(), Some(Record::Session(_))), "{name}");
        let ends = loaded.records.iter().filter(|r| matches!(r, Record::ScanEnd(_))).count();
        assert_eq!(ends, 1, "{name}");
    }
    assert_eq!(faults(folder.path()).0, 0);
}

#[test]
fn daily_rotation() {
    let folder = tempfile::tempdir().expect("a folder");
    let day1 = time("2026-03-01T23:59:59Z");
    let mut log = LogFolder::open(folder.path(), rotation(1 << 20), day1).expect("opens");
    append_all(&mut log, &scan(1), day1);
    append_all(&mut log, &scan(2)[1..], time("2026-03-02T00:00:01Z"));
    append_all(&mut log, &scan(3)[1..], time("2026-03-02T12:00:00Z"));
    append_all(&mut log, &scan(4)[1..], time("2026-02-27T12:00:00Z"));
    assert_eq!(
        names(folder.path()),
        [
            "sonard-20260301T235959Z.jsonl",
            "sonard-20260302T000001Z.jsonl",
            "sonard-20260302T000001Z_000001.jsonl"
        ]
    );
    assert!(log.path().ends_with("sonard-20260302T000001Z_000001.jsonl"), "the newest is written");
}

#[test]
fn continues_after_a_crash() {
    let folder = tempfile::tempdir().expect("a folder");
    let now = time("2026-03-01T10:00:00Z");
    let mut log = LogFolder::open(folder.path(), rotation(1 << 20), now).expect("opens");
    append_all(&mut log, &scan(1)[..4], now);
    let path = log.path().to_path_buf();
    drop(log);
    let whole = fs::read(&path).expect("readable");
    fs::write(&path, &whole[..whole.len() - 20]).expect("a power cut");

    let mut log = LogFolder::open(folder.path(), rotation(1 << 20), now).expect("opens");
    append_all(&mut log, &scan(2), now);
    log.close(now).expect("syncs");
    assert_eq!(names(folder.path()).len(), 1);
    assert_eq!(faults(folder.path()).0, 0, "an event explains the gap");
    let text = fs::read_to_string(&path).expect("readable");
    assert!(text.contains("the program ended within the previous scan"), "{text}");
}

#[test]
fn removes_the_oldest_logs() {
    let folder = tempfile::tempdir().expect("a folder");
    let now = time("2026-03-01T10:00:00Z");
    let bytes = LOG.len() as u64;
    let limits = Rotation { keep_bytes: 3 * bytes, ..rotation(1) };
    let mut log = LogFolder::open(folder.path(), limits, now).expect("opens");
    for n in 1..=10 {
        append_all(&mut log, &scan(n)[usize::from(n > 1)..], now);
    }
    let files = log_files(folder.path()).expect("readable");
    let total: u64 = files.iter().map(|file| file.bytes).sum();
    assert!((2..=4).contains(&files.len()) && total <= 4 * bytes, "{files:?}");
    let newest = files.last().map(|file| folder.path().join(&file.name));
    assert_eq!(newest.as_deref(), Some(log.path()));
}

#[test]
fn does_not_continue_other_format() {
    let folder = tempfile::tempdir().expect("a folder");
    let now = time("2026-03-01T10:00:00Z");
    let other = LOG.replacen("\"format\":1", "\"format\":2", 1);
    fs::write(folder.path().join("sonard-20260301T100000Z.jsonl"), &other).expect("written");
    let mut log = LogFolder::open(folder.path(), rotation(1 << 20), now).expect("opens");
    append_all(&mut log, &scan(1), now);
    log.close(now).expect("syncs");
    let [first, second] = &names(folder.path())[..] else { panic!("two logs") };
    assert_eq!(fs::read_to_string(folder.path().join(first)).expect("readable"), other);
    let findings =
        crate::check_log(&fs::read(folder.path().join(second)).expect("readable")[..], |finding| {
            panic!("{finding}")
        });
    assert_eq!(findings.expect("readable").scans, 1);
}
