//! Writer on a failing disk.

use std::{
    io,
    path::Path,
    time::{Duration, Instant},
};

use proptest::prelude::*;
use sonard_records::{EventKind, encode_line};

use super::*;
use crate::{LogOutput, LogWriter, Recovered, StoreError};

/// File in memory with limited space, partial writes and optionally without truncation.
#[derive(Debug, Default)]
struct Disk {
    bytes: Vec<u8>,
    room: usize,
    piece: usize,
    rigid: bool,
    sync_fails: bool,
    writes: usize,
    /// Length at each sync.
    synced: Vec<usize>,
}

impl LogOutput for &mut Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writes += 1;
        let count = bytes.len().min(self.room - self.bytes.len()).min(self.piece);
        if count == 0 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        self.bytes.extend(&bytes[..count]);
        Ok(count)
    }

    fn sync(&mut self) -> io::Result<()> {
        if self.sync_fails {
            return Err(io::Error::other("disk on fire"));
        }
        self.synced.push(self.bytes.len());
        Ok(())
    }

    fn remove_last(&mut self, bytes: u64) -> io::Result<()> {
        if self.rigid {
            return Err(io::ErrorKind::Unsupported.into());
        }
        self.bytes.truncate(self.bytes.len() - bytes as usize);
        Ok(())
    }
}

fn disk() -> Disk {
    Disk { room: usize::MAX, piece: usize::MAX, ..Disk::default() }
}

fn lines(records: &[Record]) -> Vec<Vec<u8>> {
    let line = |record| {
        let mut line = Vec::new();
        encode_line(record, &mut line).expect("clean");
        line
    };
    records.iter().map(line).collect()
}

#[test]
fn writes_and_syncs_per_record() {
    let mut disk = disk();
    let mut writer = LogWriter::new(&mut disk, Path::new("log"));
    for record in records() {
        writer.append(&record).expect("written");
    }
    assert_eq!((writer.appended(), writer.synced()), (11, 10));
    writer.close().expect("it syncs");
    let lines = lines(&records());
    let total = lines.iter().map(Vec::len).sum::<usize>();
    assert_eq!(disk.bytes, lines.concat());
    assert_eq!(disk.writes, lines.len());
    assert_eq!(disk.synced, [total - lines[10].len(), total]);
}

#[test]
fn sync_interval() {
    let (mut disk, record) = (disk(), &records()[2]);
    let begin = Instant::now();
    let mut writer =
        LogWriter::new(&mut disk, Path::new("log")).with_sync_interval(Duration::from_secs(1));
    let at = |ms| begin + Duration::from_millis(ms);
    for (ms, synced) in [(0, 0), (900, 0), (1000, 3), (1500, 3), (2400, 3), (2500, 6)] {
        writer.append_at(record, at(ms)).expect("written");
        assert_eq!(writer.synced(), synced, "after {ms} ms");
    }
    writer.append_at(record, at(3000)).expect("written");
    writer.sync_if_due(at(3999)).expect("nothing is due");
    assert_eq!(writer.synced(), 6);
    writer.sync_if_due(at(4000)).expect("it syncs");
    assert_eq!(writer.synced(), 7);
}

#[test]
fn failed_sync_is_final() {
    let mut disk = Disk { sync_fails: true, ..disk() };
    let mut writer = LogWriter::new(&mut disk, Path::new("far/log"));
    writer.append(&records()[0]).expect("no sync yet");
    let error = writer.sync().expect_err("the disk is on fire");
    assert!(matches!(error, StoreError::Sync { unsynced: 1, .. }), "{error}");
    assert!(error.to_string().contains("far/log"), "{error}");
    let error = writer.append(&records()[1]).expect_err("it can't be relied on");
    assert!(matches!(error, StoreError::Failed { .. }), "{error}");
}

#[test]
fn invalid_record_writes_nothing() {
    let mut disk = disk();
    let mut writer = LogWriter::new(&mut disk, Path::new("log"));
    let Record::Ping(mut ping) = records()[2].clone() else { panic!("the third is a ping") };
    ping.azimuth_deg = f64::NAN;
    let error = writer.append(&Record::Ping(ping)).expect_err("not a number");
    assert!(matches!(error, StoreError::Record { .. }), "{error}");
    writer.append(&records()[2]).expect("the next is fine");
    drop(writer);
    assert_eq!(disk.bytes, lines(&records())[2]);
}

proptest! {
    /// Full disk and partial writes: the log contains exactly the acknowledged records, and
    /// accepts further ones once space is free.
    #[test]
    fn full_disk(room in 0..5000_usize, piece in 1..2000_usize) {
        let mut disk = Disk { room, piece, ..disk() };
        let mut appended = Vec::new();
        for record in records() {
            let mut writer = LogWriter::new(&mut disk, Path::new("log"));
            match writer.append(&record) {
                Ok(()) => appended.push(record),
                Err(StoreError::Write { source, .. }) => {
                    prop_assert_eq!(source.kind(), io::ErrorKind::StorageFull);
                }
                Err(other) => panic!("{other}"),
            }
        }
        prop_assert_eq!(&disk.bytes, &lines(&appended).concat());
        disk.room = usize::MAX;
        LogWriter::new(&mut disk, Path::new("log")).append(&records()[0]).expect("room again");
        prop_assert!(disk.bytes.ends_with(&lines(&records())[0]));
    }

    /// Without truncation at most one line is torn, with an error; reopening keeps all earlier
    /// records.
    #[test]
    fn full_disk_without_truncation(room in 0..5000_usize) {
        let mut disk = Disk { room, rigid: true, ..disk() };
        let mut writer = LogWriter::new(&mut disk, Path::new("log"));
        let (mut appended, mut torn) = (Vec::new(), false);
        for record in records() {
            match writer.append(&record) {
                Ok(()) => appended.push(record),
                Err(StoreError::Torn { .. }) => torn = true,
                Err(StoreError::Write { .. } | StoreError::Failed { .. }) => {}
                Err(other) => panic!("{other}"),
            }
        }
        drop(writer);
        let whole = lines(&appended).concat();
        prop_assert_eq!(torn, disk.bytes.len() > whole.len());
        prop_assert!(disk.bytes.starts_with(&whole));
        let (_folder, log) = fast_folder();
        written(&log, &disk.bytes);
        drop(LogWriter::open(&log).expect("repaired"));
        prop_assert!(read(&log).as_bytes().starts_with(&whole));
    }
}

#[test]
fn full_device() {
    let mut writer = LogWriter::open(Path::new("/dev/full")).expect("it opens");
    let error = writer.append(&records()[0]).expect_err("it is always full");
    assert!(matches!(&error, StoreError::Write { source, .. }
        if source.kind() == io::ErrorKind::StorageFull));
    assert!(error.to_string().contains("/dev/full"), "{error}");
    assert!(error.help().contains("free space"), "{}", error.help());
}

#[test]
fn lock_excludes_second_writer() {
    let (_folder, log) = folder();
    let first = LogWriter::open(&log).expect("it is created");
    let error = LogWriter::open(&log).expect_err("it is taken");
    assert!(matches!(error, StoreError::Busy { .. }), "{error}");
    let error = crate::repair(&log).expect_err("it is taken");
    assert!(matches!(error, StoreError::Busy { .. }), "{error}");
    drop(first);
    LogWriter::open(&log).expect("it is free again");
}

#[test]
fn reopens_after_a_torn_line() {
    let (folder, log) = folder();
    for (cut, recovered) in [(0, false), (1, true), (LOG.len() - 30, true)] {
        written(&log, &LOG[..LOG.len() - cut]);
        let mut writer = LogWriter::open(&log).expect("repaired");
        assert_eq!(writer.recovered().is_some(), recovered, "cut by {cut}");
        writer.append(&records()[2]).expect("written");
        writer.close().expect("it syncs");
        let lines = read(&log);
        assert!(lines.as_bytes().ends_with(&super::faults::lines(&records())[2]), "cut by {cut}");
    }
    // The 30 torn bytes are kept, and an event records them.
    assert_eq!(read(folder.path().join("scan.jsonl.torn-1")), LOG[..30]);
    let loaded = crate::load(&log).expect("exists");
    assert_eq!(loaded.damaged, []);
    let Record::Event(event) = &loaded.records[0] else { panic!("{:?}", loaded.records) };
    assert_eq!(event.kind, EventKind::Gap);
    assert!(event.detail.contains("30 bytes") && event.detail.contains("torn-1"), "{event:?}");
}

#[test]
fn adds_a_missing_newline() {
    let (_folder, log) = folder();
    written(&log, LOG.trim_end());
    let writer = LogWriter::open(&log).expect("repaired");
    assert_eq!(writer.recovered(), Some(&Recovered::Newline));
    assert_eq!(read(&log), LOG);
}
