//! Input logs of verbs, read scan by scan in bounded memory, with damaged lines reported once.

use std::{
    ffi::OsStr,
    fs, io,
    path::{Path, PathBuf},
};

use super::{Failure, output::register_input, progress};
use crate::{
    compare::keep_every_second,
    scan::{Record, ScanView, text::format_count},
    store::{
        COLLECTED_SCANS, FileKind, Line, LineError, StoreError, log_files, open_for_reading,
        read_log,
    },
};

/// Maximum number of reported damaged lines; further ones are counted.
const MAX_REPORTED: usize = 5;

/// Damaged lines found in a log.
#[derive(Debug, Default)]
pub(super) struct Damage {
    count: u64,
}

impl Damage {
    /// Reports a damaged line, up to a limit.
    pub(super) fn report(&mut self, log: &Path, error: &LineError) {
        self.count += 1;
        if self.count <= MAX_REPORTED as u64 {
            notice!("warning: {}: {error}; line skipped", log.display());
        }
    }

    /// Reports the number of further damaged lines.
    pub(super) fn report_rest(&self, log: &Path) {
        if let Some(more) = self.count.checked_sub(MAX_REPORTED as u64).filter(|more| *more > 0) {
            let more = format_count(more, "more damaged line");
            notice!("warning: {}: {more}; see `sonard log verify`", log.display());
        }
    }
}

/// Expands folders to their logs, ordered by name, and registers all of them as inputs. A
/// collection is expanded to its scans, a folder without logs of its own to the daemons' logs in
/// its subfolders (one per robot).
///
/// # Errors
///
/// A folder can't be read or contains no log.
/// A folder can't be read, or has no log in it.
pub(super) fn logs_in(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut logs = Vec::new();
    for path in paths {
        if !path.is_dir() {
            logs.push(path.clone());
            continue;
        }
        let scans = path.join(COLLECTED_SCANS);
        let folder = if scans.is_dir() { &scans } else { path };
        let found = logs_in_folder(folder).and_then(|found| match found.is_empty() {
            true => logs_of_robots(folder),
            false => Ok(found),
        });
        let found = found.map_err(|error| {
            Failure::input(
                format!("cannot read the folder {}: {error}", folder.display()),
                "give a readable folder, or logs",
            )
        })?;
        if found.is_empty() {
            return Err(Failure::input(
                format!("no log in the folder {}", folder.display()),
                "give a folder written by `sonard run --log` or `sonard collect`, or logs (.jsonl)",
            ));
        }
        found.iter().for_each(|log| register_input(log));
        logs.extend(found);
    }
    Ok(logs)
}

fn logs_in_folder(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path()));
    let paths: Vec<_> = entries.collect::<io::Result<_>>()?;
    let is_log = |path: &PathBuf| path.extension() == Some(OsStr::new("jsonl")) && path.is_file();
    let mut logs: Vec<_> = paths.into_iter().filter(is_log).collect();
    logs.sort();
    Ok(logs)
}

/// Returns the logs of daemons in the subfolders of `folder`, ordered by subfolder and name.
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
    reader.fill_buf().map_or(FileKind::Binary, FileKind::detect)
}

fn no_record(log: &Path, kind: FileKind) -> Failure {
    Failure::input(
        format!("{} contains no records: it looks like {kind}", log.display()),
        kind.help_for_log(),
    )
}

/// Passes each scan of a log to `take` as soon as it has ended; reports lines that are not records.
///
/// # Errors
///
/// The log can't be read or contains no records, or `take` fails, which ends the reading.
pub(super) fn for_each_scan(
    log: &Path,
    take: impl FnMut(ScanView) -> Result<(), Failure>,
) -> Result<(), Failure> {
    for_each_record_and_scan(log, |_| {}, take)
}

/// Passes each scan of a log to `take`, and before it each record up to the end of the scan to
/// `inspect`.
///
/// # Errors
///
/// As [`for_each_scan`].
pub(super) fn for_each_record_and_scan(
    log: &Path,
    inspect: impl FnMut(&Record),
    mut take: impl FnMut(ScanView) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut outcome = Ok(());
    each_scan(log, inspect, |scan| {
        if outcome.is_ok() {
            outcome = take(scan);
        }
        outcome.is_ok()
    })?;
    outcome
}

/// Passes scans to `take` until it returns `false`.
fn each_scan(
    log: &Path,
    mut inspect: impl FnMut(&Record),
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
                    damage.report(log, &error);
                    Some(None)
                }
                Err(error) => stop(error),
            },
            Err(source) => stop(StoreError::Read { path: log.into(), source }),
        })
        .flatten()
        .inspect(|record| {
            any = true;
            inspect(record);
        });
    for scan in ScanView::stream(records) {
        if !take(scan) {
            break;
        }
    }
    damage.report_rest(log);
    match broken {
        Some(error) => Err(error.into()),
        None if any => Ok(()),
        None => Err(no_record(log, kind)),
    }
}

/// Maximum number of readings in a picture: more are neither distinguishable nor affordable in
/// memory.
const MAX_DRAWN_READINGS: usize = 60_000;

/// Scans for a picture: all of them, or an even selection.
#[derive(Debug)]
pub(super) struct DrawnScans {
    scans: Vec<ScanView>,
    readings: usize,
    /// Interval of the kept scans.
    every: usize,
    seen: usize,
}

impl Default for DrawnScans {
    fn default() -> Self {
        Self { scans: Vec::new(), readings: 0, every: 1, seen: 0 }
    }
}

impl DrawnScans {
    pub(super) fn add(&mut self, scan: ScanView) {
        self.seen += 1;
        if !(self.seen - 1).is_multiple_of(self.every) {
            return;
        }
        self.readings += scan.pings.len();
        self.scans.push(scan);
        while self.readings > MAX_DRAWN_READINGS && self.scans.len() > 1 {
            keep_every_second(&mut self.scans);
            self.readings = self.scans.iter().map(|scan| scan.pings.len()).sum();
            self.every *= 2;
        }
    }

    /// Returns the scans to draw, with a notice if they are not all.
    pub(super) fn finish(self) -> Vec<ScanView> {
        if self.every > 1 {
            notice!(
                "note: {} scans are too many for a picture: one in {} is drawn, {} in total",
                self.seen,
                self.every,
                self.scans.len()
            );
        }
        self.scans
    }
}

/// Returns the first log, whose neighbours share its scenes.
pub(super) fn first_log(logs: &[PathBuf]) -> PathBuf {
    let first = logs_in(logs).ok().and_then(|logs| logs.into_iter().next());
    first.unwrap_or_else(|| "-".into())
}
