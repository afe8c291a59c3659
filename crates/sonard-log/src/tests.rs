//! Tests of logs by subject, with a shared fixture.

mod checking;
mod faults;
mod folder;
mod format;
mod history;
mod lost_files;
mod reading;
mod repairing;
mod scenes;

use std::path::{Path, PathBuf};

use sonard_records::{Record, decode_line};

const LOG: &str = include_str!("../../../tests/fixtures/small.jsonl");

fn records() -> Vec<Record> {
    LOG.lines().map(|line| decode_line(line.as_bytes()).expect("clean")).collect()
}

/// Creates a temporary folder and the path of a log in it.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = folder.path().join("scan.jsonl");
    (folder, log)
}

/// Creates a temporary folder in memory where possible: thousands of syncs to a disk take minutes.
fn fast_folder() -> (tempfile::TempDir, PathBuf) {
    let Ok(folder) = tempfile::tempdir_in("/dev/shm") else { return folder() };
    let log = folder.path().join("scan.jsonl");
    (folder, log)
}

fn written(log: &Path, bytes: impl AsRef<[u8]>) {
    std::fs::write(log, bytes).expect("a temporary file");
}

fn read(log: impl AsRef<Path>) -> String {
    std::fs::read_to_string(log).expect("exists")
}
