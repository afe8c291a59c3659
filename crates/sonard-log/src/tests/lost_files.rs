//! Logs that are removed, renamed, replaced or truncated between two checks of their file.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use jiff::Timestamp;
use sonard_records::{Record, decode_line};
use uuid::Uuid;

use super::LOG;
use crate::{LogFolder, Rotation, check, log_files, open_for_reading};

/// Folder of logs within a parent folder, with the time of all its records.
struct Rig {
    parent: tempfile::TempDir,
    log: LogFolder,
    now: Timestamp,
}

impl Rig {
    /// Opens a log whose first scan was checked.
    fn new() -> Self {
        let parent = tempfile::tempdir().expect("a folder");
        let now = "2026-11-21T15:00:00Z".parse().expect("a time");
        let sync_interval = Duration::from_secs(3600);
        let rotation = Rotation { max_bytes: 1 << 20, daily: false, keep_bytes: 0, sync_interval };
        let log = LogFolder::open(&parent.path().join("log"), rotation, now).expect("opens");
        let mut rig = Self { parent, log, now };
        rig.append(&scan(1));
        rig.log.inspect(now).expect("in place");
        assert_eq!(rig.log.take_incident(), None);
        rig
    }

    fn append(&mut self, records: &[Record]) {
        for record in records {
            self.log.append(record, self.now).expect("written");
        }
    }

    fn path(&self) -> PathBuf {
        self.log.path().into()
    }

    /// Closes the log and returns how often each reading of each scan is in the folder.
    fn close(mut self) -> Counts {
        let counters = |log: &LogFolder| [log.appended(), log.synced(), log.uncertain()];
        let before = counters(&self.log);
        self.log.close(self.now).expect("syncs");
        let [appended, synced, uncertain] = counters(&self.log);
        assert!(before[0] <= appended && before[1] <= synced, "counters decrease");
        assert_eq!(synced + uncertain, appended);
        readings(&self.parent.path().join("log"))
    }
}

/// Number of occurrences of each reading by scan.
type Counts = BTreeMap<u128, Vec<u32>>;

/// Records of the fixture with scan number `n`; the session is the first scan's.
fn scan(n: u128) -> Vec<Record> {
    let with_id = |line: &str| {
        let mut record = decode_line(line.as_bytes()).expect("the fixture is clean");
        match &mut record {
            Record::ScanStart(start) => start.scan = Uuid::from_u128(n),
            Record::Ping(ping) => ping.scan = Uuid::from_u128(n),
            Record::ScanEnd(end) => end.scan = Uuid::from_u128(n),
            Record::Session(_) | Record::Event(_) => {}
        }
        record
    };
    LOG.lines().skip(usize::from(n > 1)).map(with_id).collect()
}

/// Counts the readings in a folder whose logs are all valid.
fn readings(folder: &Path) -> Counts {
    let mut counts = Counts::new();
    for file in log_files(folder).expect("readable") {
        let path = folder.join(&file.name);
        let reader = open_for_reading(&path).expect("readable");
        let totals = check(reader, |finding| println!("{}: {finding}", file.name));
        assert_eq!(totals.expect("readable").problems, 0, "{}", file.name);
        let text = fs::read_to_string(&path).expect("readable");
        text.lines().for_each(|line| count_reading(line, &mut counts));
    }
    counts
}

fn count_reading(line: &str, counts: &mut Counts) {
    if let Record::Ping(ping) = decode_line(line.as_bytes()).expect("valid") {
        let counts = counts.entry(ping.scan.as_u128()).or_insert_with(|| vec![0; 7]);
        counts[ping.index as usize] += 1;
    }
}

fn once(scans: impl IntoIterator<Item = u128>) -> Counts {
    scans.into_iter().map(|scan| (scan, vec![1; 7])).collect()
}

#[test]
fn removed_after_a_check() {
    let mut rig = Rig::new();
    fs::remove_file(rig.path()).expect("it is there");
    let [second, third] = [scan(2), scan(3)];
    // The first record of a scan is preceded by a check.
    rig.append(&second[..1]);
    assert!(rig.log.take_incident().expect("an incident").contains("was removed"));
    rig.append(&second[1..]);
    fs::remove_file(rig.path()).expect("it is there");
    rig.append(&third[..4]);
    assert_eq!(rig.close(), {
        let mut counts = once([2]);
        counts.insert(3, vec![1, 1, 1, 0, 0, 0, 0]);
        counts
    });
}

#[test]
fn removed_within_a_scan_that_ends() {
    let mut rig = Rig::new();
    let second = scan(2);
    rig.append(&second[..4]);
    rig.log.inspect(rig.now).expect("in place");
    rig.append(&second[4..6]);
    fs::remove_file(rig.path()).expect("it is there");
    rig.append(&second[6..]);
    rig.append(&scan(3));
    assert_eq!(rig.close(), once([2, 3]));
}

#[test]
fn removed_before_the_end() {
    let mut rig = Rig::new();
    rig.append(&scan(2));
    fs::remove_file(rig.path()).expect("it is there");
    assert_eq!(rig.close(), once([2]));
}

#[test]
fn removed_twice_between_checks() {
    let mut rig = Rig::new();
    rig.append(&scan(2));
    fs::remove_file(rig.path()).expect("it is there");
    rig.log.inspect(rig.now).expect("a new file");
    fs::remove_file(rig.path()).expect("it is there");
    rig.log.inspect(rig.now).expect("a new file");
    let text = fs::read_to_string(rig.path()).expect("readable");
    assert_eq!(text.matches("was removed").count(), 2, "both gaps are recorded");
    assert_eq!(rig.close(), once([2]));
}

#[test]
fn removed_folder() {
    let mut rig = Rig::new();
    rig.append(&scan(2));
    fs::remove_dir_all(rig.parent.path().join("log")).expect("it is there");
    assert_eq!(rig.close(), once([2]));
}

#[test]
fn replaced_by_another_file() {
    let mut rig = Rig::new();
    rig.append(&scan(2));
    let other = rig.parent.path().join("other");
    fs::write(&other, LOG).expect("written");
    let replaced = rig.path();
    fs::rename(&other, &replaced).expect("renamed");
    rig.append(&scan(3));
    let parent = rig.parent.path().join("log");
    assert_eq!(fs::read_to_string(&replaced).expect("readable"), LOG, "the other file is kept");
    fs::remove_file(&replaced).expect("it is there");
    drop(rig.log);
    assert_eq!(readings(&parent), once([2, 3]));
}

#[test]
fn renamed_keeps_its_records() {
    let mut rig = Rig::new();
    let second = scan(2);
    rig.append(&second[..4]);
    fs::rename(rig.path(), rig.path().with_file_name("sonard-20261121T140000Z.jsonl"))
        .expect("renamed");
    rig.log.inspect(rig.now).expect("examined");
    rig.append(&second[4..]);
    rig.append(&scan(3));
    assert_eq!(rig.close(), once([1, 2, 3]));
}

#[test]
fn renamed_then_removed() {
    let mut rig = Rig::new();
    let second = scan(2);
    rig.append(&second[..4]);
    let moved = rig.parent.path().join("moved");
    fs::rename(rig.path(), &moved).expect("renamed");
    rig.log.inspect(rig.now).expect("examined");
    rig.append(&second[4..]);
    fs::remove_file(&moved).expect("it is there");
    rig.append(&scan(3));
    assert_eq!(rig.close(), once([2, 3]));
}

#[test]
fn hidden_name_is_a_removal() {
    for hidden in [".nfs000000000001a2b300000001", ".fuse_hidden0000a1b200000001"] {
        let mut rig = Rig::new();
        rig.append(&scan(2));
        fs::rename(rig.path(), rig.path().with_file_name(hidden)).expect("renamed");
        assert_eq!(rig.close(), once([2]), "{hidden}");
    }
}

#[test]
fn truncated_within_a_scan() {
    let mut rig = Rig::new();
    let second = scan(2);
    rig.append(&second[..4]);
    rig.log.inspect(rig.now).expect("in place");
    let truncated = rig.path();
    fs::write(&truncated, "").expect("it is there");
    rig.append(&second[4..]);
    rig.append(&scan(3));
    // Lines that were written after the truncation moved to the new file.
    assert!(!truncated.exists());
    assert_eq!(rig.close(), once([2, 3]));
}

#[test]
fn shortened_by_an_editor() {
    let mut rig = Rig::new();
    let path = rig.path();
    rig.append(&scan(2));
    // All lines but the event after the first scan.
    let text = fs::read_to_string(&path).expect("readable");
    let kept: Vec<&str> = text.split_inclusive('\n').collect();
    fs::write(&path, kept.concat().replacen(kept[10], "", 1)).expect("it is there");
    rig.append(&scan(3));
    assert_eq!(rig.close(), once([1, 2, 3]));
}

#[test]
fn lengthened_by_others() {
    use std::io::Write as _;
    let mut rig = Rig::new();
    rig.append(&scan(2));
    let mut other = fs::OpenOptions::new().append(true).open(rig.path()).expect("opens");
    other.write_all(LOG.lines().last().expect("a line").as_bytes()).expect("written");
    other.write_all(b"\n").expect("written");
    rig.append(&scan(3));
    assert_eq!(rig.close(), once([1, 2, 3]));
}

#[test]
fn no_room_for_the_new_file() {
    let mut rig = Rig::new();
    rig.append(&scan(2));
    let folder = rig.parent.path().join("log");
    fs::remove_dir_all(&folder).expect("it is there");
    fs::write(&folder, "no folder").expect("the name is free");
    let third = scan(3);
    assert!(rig.log.append(&third[0], rig.now).is_err());
    assert!(rig.log.inspect(rig.now).is_ok(), "nothing is open");
    fs::remove_file(&folder).expect("it is there");
    rig.append(&third);
    assert_eq!(rig.close(), once([2, 3]));
}

#[test]
fn text_within_a_line() {
    use std::io::Write as _;
    // Before a reading, the last reading, and the end of the scan.
    for count in [3, 7, 8] {
        let mut rig = Rig::new();
        let damaged = rig.path();
        let second = scan(2);
        rig.append(&second[..count]);
        let mut other = fs::OpenOptions::new().append(true).open(&damaged).expect("opens");
        other.write_all(b"no line feed").expect("written");
        rig.append(&second[count..]);
        rig.append(&scan(3));
        rig.log.close(rig.now).expect("syncs");
        // The damaged file has all readings but one.
        let text = fs::read_to_string(&damaged).expect("readable");
        let lines = text.lines().filter(|line| !line.contains("no line feed"));
        let mut counts = Counts::new();
        lines.for_each(|line| count_reading(line, &mut counts));
        fs::remove_file(&damaged).expect("it is there");
        for (scan, repeated) in readings(&rig.parent.path().join("log")) {
            let counts = counts.entry(scan).or_insert_with(|| vec![0; 7]);
            counts.iter_mut().zip(repeated).for_each(|(count, more)| *count += more);
        }
        assert_eq!(counts, once([1, 2, 3]), "after {count} records");
    }
}

#[test]
fn log_of_a_single_scan() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("scan.jsonl");
    let open = || {
        let mut writer = crate::LogWriter::open(&log).expect("opens");
        scan(1).iter().for_each(|record| writer.append(record).expect("written"));
        writer
    };
    let writer = open();
    fs::remove_file(&log).expect("it is there");
    writer.close().expect("written again");
    assert_eq!(crate::load(&log).expect("readable").records, scan(1));
    fs::remove_file(&log).expect("it is there");

    let writer = open();
    fs::rename(&log, folder.path().join("moved")).expect("renamed");
    let error = writer.close().expect_err("it is elsewhere");
    assert!(error.to_string().contains("was moved or replaced while it was written"), "{error}");
    let writer = open();
    fs::write(&log, "").expect("it is there");
    let error = writer.close().expect_err("it is empty");
    assert!(error.to_string().contains("0 bytes instead of"), "{error}");
    fs::remove_file(&log).expect("it is there");
    let writer = open();
    fs::remove_dir_all(folder.path()).expect("it is there");
    let error = writer.close().expect_err("no folder");
    assert!(error.to_string().contains("was removed while it was written"), "{error}");
}
