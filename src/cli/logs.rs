//! Logs as verbs read them: scan by scan, so that a collection of days need not be in memory, and with
//! what is wrong in them told once.

use std::{
    ffi::OsStr,
    fs, io,
    path::{Path, PathBuf},
};

use super::{Failure, output::note_input, progress};
use crate::{
    collect::SCANS,
    compare::keep_every_second,
    scan::{Record, ScanView},
    store::{FileKind, Line, LineError, StoreError, log_files, open_for_reading, read_log},
};

/// Lines that can't be read and are named; of more only the number is told.
const SHOWN: usize = 5;

/// Damaged lines as they are met.
#[derive(Debug, Default)]
pub(super) struct Damage {
    count: u64,
}

impl Damage {
    /// Names a line, unless enough are named.
    pub(super) fn note(&mut self, log: &Path, error: &LineError) {
        self.count += 1;
        if self.count <= SHOWN as u64 {
            notice!("warning: {}: {error}; the line is left out", log.display());
        }
    }

    /// Says how many more there were.
    pub(super) fn sum_up(&self, log: &Path) {
        if let Some(more) = self.count.checked_sub(SHOWN as u64).filter(|more| *more > 0) {
            notice!(
                "warning: {}: {more} more damaged lines; see `sonard log verify`",
                log.display()
            );
        }
    }
}

/// Expands folders to their logs, ordered by name, and notes all of them as read: a collection to its scans, a folder
/// without logs of its own to those of daemons in its subfolders (one per robot).
///
/// # Errors
/// A folder can't be read, or has no log in it.
pub(super) fn logs_in(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut logs = Vec::new();
    for path in paths {
        if !path.is_dir() {
            logs.push(path.clone());
            continue;
        }
        let scans = path.join(SCANS);
        let folder = if scans.is_dir() { &scans } else { path };
        let found = logs_of(folder).and_then(|found| match found.is_empty() {
            true => logs_of_robots(folder),
            false => Ok(found),
        });
        let found = found.map_err(|error| {
            Failure::input(
                format!("cannot read the folder {}: {error}", folder.display()),
                "give a folder that you may read, or logs",
            )
        })?;
        if found.is_empty() {
            return Err(Failure::input(
                format!("there is no log in the folder {}", folder.display()),
                "give a folder as `sonard run --log` or `sonard collect` writes it, or logs: they end in .jsonl",
            ));
        }
        found.iter().for_each(|log| note_input(log));
        logs.extend(found);
    }
    Ok(logs)
}

fn logs_of(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path()));
    let paths: Vec<_> = entries.collect::<io::Result<_>>()?;
    let is_log = |path: &PathBuf| path.extension() == Some(OsStr::new("jsonl")) && path.is_file();
    let mut logs: Vec<_> = paths.into_iter().filter(is_log).collect();
    logs.sort();
    Ok(logs)
}

/// Logs of daemons in the subfolders of `folder`, ordered by subfolder and name.
fn logs_of_robots(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path()));
    let mut robots: Vec<_> = entries.collect::<io::Result<_>>()?;
    robots.retain(|robot| robot.is_dir());
    robots.sort();
    let mut logs = Vec::new();
    for robot in robots {
        logs.extend(log_files(&robot)?.into_iter().map(|log| robot.join(log.name)));
    }
    Ok(logs)
}

fn kind_of(reader: &mut impl std::io::BufRead) -> FileKind {
    reader.fill_buf().map_or(FileKind::Binary, FileKind::of)
}

fn no_record(log: &Path, kind: FileKind) -> Failure {
    Failure::input(
        format!("{} holds no record: it looks like {kind}", log.display()),
        kind.instead_of_a_log(),
    )
}

/// Hands over each scan of a log as soon as it has ended; names the lines that hold no record.
///
/// # Errors
/// The log can't be read or holds no record at all, or what `take` refuses; nothing is read after that.
pub(super) fn for_each_scan(
    log: &Path,
    take: impl FnMut(ScanView) -> Result<(), Failure>,
) -> Result<(), Failure> {
    for_each_scan_of(log, |_| {}, take)
}

/// The same, and before a scan each record up to the one that ends it is shown to `see`.
///
/// # Errors
/// As [`for_each_scan`].
pub(super) fn for_each_scan_of(
    log: &Path,
    see: impl FnMut(&Record),
    mut take: impl FnMut(ScanView) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut outcome = Ok(());
    each_scan(log, see, |scan| {
        if outcome.is_ok() {
            outcome = take(scan);
        }
        outcome.is_ok()
    })?;
    outcome
}

/// The same until `take` has had enough.
fn each_scan(
    log: &Path,
    mut see: impl FnMut(&Record),
    mut take: impl FnMut(ScanView) -> bool,
) -> Result<(), Failure> {
    let mut reader = progress::reading(log, open_for_reading(log)?);
    let kind = kind_of(&mut reader);
    let (mut damage, mut any, mut broken) = (Damage::default(), false, None);
    let mut stop = |error: StoreError| -> Option<Option<Record>> {
        broken = Some(error);
        None
    };
    let records = read_log(reader)
        .map_while(|line| match line {
            Ok(Line { record: Ok(record), .. }) => Some(Some(record)),
            Ok(Line { record: Err(error), .. }) => match error.reject_other_format(log) {
                Ok(error) => {
                    damage.note(log, &error);
                    Some(None)
                }
                Err(error) => stop(error),
            },
            Err(source) => stop(StoreError::Read { path: log.into(), source }),
        })
        .flatten()
        .inspect(|record| {
            any = true;
            see(record);
        });
    for scan in ScanView::one_by_one(records) {
        if !take(scan) {
            break;
        }
    }
    damage.sum_up(log);
    match broken {
        Some(error) => Err(error.into()),
        None if any => Ok(()),
        None => Err(no_record(log, kind)),
    }
}

/// Readings that a picture shows: more could not be told apart, and would fill the memory.
const MOST_DRAWN: usize = 60_000;

/// Scans for a picture: all of them, or evenly so many that they can be shown.
#[derive(Debug)]
pub(super) struct Drawn {
    scans: Vec<ScanView>,
    readings: usize,
    /// One scan in so many is kept.
    every: usize,
    seen: usize,
}

impl Default for Drawn {
    fn default() -> Self {
        Self { scans: Vec::new(), readings: 0, every: 1, seen: 0 }
    }
}

impl Drawn {
    pub(super) fn add(&mut self, scan: ScanView) {
        self.seen += 1;
        if !(self.seen - 1).is_multiple_of(self.every) {
            return;
        }
        self.readings += scan.pings.len();
        self.scans.push(scan);
        while self.readings > MOST_DRAWN && self.scans.len() > 1 {
            keep_every_second(&mut self.scans);
            self.readings = self.scans.iter().map(|scan| scan.pings.len()).sum();
            self.every *= 2;
        }
    }

    /// The scans to draw; says if these are not all.
    pub(super) fn finish(self) -> Vec<ScanView> {
        if self.every > 1 {
            notice!(
                "note: {} scans are more than a picture shows: one in {} is drawn, {} in all",
                self.seen,
                self.every,
                self.scans.len()
            );
        }
        self.scans
    }
}

/// Logs of one robot stand together, and their scenes with them.
pub(super) fn first_of(logs: &[PathBuf]) -> PathBuf {
    let first = logs_in(logs).ok().and_then(|logs| logs.into_iter().next());
    first.unwrap_or_else(|| "-".into())
}
