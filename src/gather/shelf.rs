//! One robot's folder: its logs as far as they were taken, and the ledger.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, BufReader},
    path::{Path, PathBuf},
};

use rustix::fs::{FlockOperation, flock};
use thiserror::Error;

use super::{
    ledger::{Ledger, Taken},
    sieve::Sieve,
};
use crate::{
    scan::Record,
    store::{LogWriter, StoreError, is_being_written, log_files, open_own, read_log},
};

/// A robot's folder, which this process alone writes to.
#[derive(Debug)]
pub struct Shelf {
    folder: PathBuf,
    robot: String,
    address: String,
    ledger: Ledger,
    open: Option<OpenLog>,
    _lock: File,
}

/// An error in the folder of a robot.
#[derive(Debug, Error)]
#[error("{message}")]
pub struct ShelfError {
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: String,
}

/// The log that is taken just now.
#[derive(Debug)]
pub(super) struct OpenLog {
    name: String,
    writer: LogWriter,
    kept_bytes: u64,
    pub(super) sieve: Sieve,
}

impl ShelfError {
    fn new(message: impl Into<String>, help: &str) -> Self {
        Self { message: message.into(), help: help.into() }
    }

    fn of(path: &Path, error: &io::Error) -> Self {
        Self::new(format!("{}: {error}", path.display()), "check free space and permissions")
    }
}

impl From<StoreError> for ShelfError {
    fn from(error: StoreError) -> Self {
        Self::new(error.to_string(), "check free space and permissions")
    }
}

impl Shelf {
    /// Checks that a folder may be gathered into, and makes it: not one that a daemon logs to, nor one within it.
    ///
    /// # Errors
    /// When it may not, or can't be made.
    pub fn check_root(root: &Path) -> Result<(), ShelfError> {
        let help = "give a folder of its own with --out";
        fs::create_dir_all(root).map_err(|error| ShelfError::of(root, &error))?;
        let whole = root.canonicalize().map_err(|error| ShelfError::of(root, &error))?;
        for folder in whole.ancestors() {
            let logs = log_files(folder).unwrap_or_default();
            let Some(newest) = logs.last() else { continue };
            let log = folder.join(&newest.name);
            let is_written = File::open(&log).is_ok_and(|log| is_being_written(&log));
            if folder == whole || is_written {
                let message = format!("{} is a folder of logs of its own", folder.display());
                return Err(ShelfError::new(message, help));
            }
        }
        Ok(())
    }

    /// The folder of a robot whose daemon is at `address`. That place may have been another robot's before only if the
    /// robot `was_named`.
    ///
    /// # Errors
    /// When another process gathers into it, it holds something else, or it can't be read.
    pub fn open(
        root: &Path,
        robot: &str,
        address: &str,
        was_named: bool,
    ) -> Result<Self, ShelfError> {
        let folder = root.join(robot);
        let is_new = !super::is_of_robot(&folder);
        if is_new && !was_named {
            no_other_before(root, robot, address)?;
        }
        fs::create_dir_all(&folder).map_err(|error| ShelfError::of(&folder, &error))?;
        let fail = |error: io::Error| ShelfError::of(&folder, &error);
        let lock = File::open(&folder).map_err(fail)?;
        if flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
            let message = format!("another process gathers into {}", folder.display());
            return Err(ShelfError::new(message, "wait for it, or end it"));
        }
        if is_new && !log_files(&folder).map_err(fail)?.is_empty() {
            let message = format!("{} holds logs that were not gathered", folder.display());
            return Err(ShelfError::new(message, "give another folder with --out"));
        }
        let ledger = Ledger::read(&folder).map_err(fail)?.unwrap_or_default();
        let (robot, address) = (robot.into(), address.into());
        Ok(Self { folder, robot, address, ledger, open: None, _lock: lock })
    }

    /// What was taken so far.
    #[must_use]
    pub const fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// The robot it is of.
    #[must_use]
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// Writes down that the robot's daemon, which has what was taken before, is there; and forgets logs whose copies
    /// somebody cut or removed, so that they are taken anew.
    pub(super) fn confirm(&mut self) -> Result<(), ShelfError> {
        let before = self.ledger.clone();
        (self.ledger.robot, self.ledger.address) = (self.robot.clone(), self.address.clone());
        let folder = &self.folder;
        let length = |name: &str| fs::metadata(folder.join(name)).map_or(0, |file| file.len());
        self.ledger.logs.retain(|name, taken| length(name) >= taken.kept_bytes);
        if self.ledger == before && super::is_of_robot(&self.folder) {
            return Ok(());
        }
        self.open = None;
        self.ledger.write(&self.folder).map_err(|error| ShelfError::of(&self.folder, &error))
    }

    /// How far a log was taken.
    pub(super) fn taken(&self, name: &str) -> Taken {
        self.ledger.logs.get(name).cloned().unwrap_or_default()
    }

    /// Gets a log ready that is to be taken on from where it was taken to: what stands behind that in its copy is cut off.
    pub(super) fn take_on(&mut self, name: &str) -> Result<(), ShelfError> {
        if self.open.as_ref().is_some_and(|open| open.name == name) {
            return Ok(());
        }
        self.open = None;
        let path = self.folder.join(name);
        let fail = |error: io::Error| ShelfError::of(&path, &error);
        let kept_bytes = self.taken(name).kept_bytes;
        let file = open_own(OpenOptions::new().read(true).write(true).create(true), &path);
        let file = file.map_err(fail)?;
        file.set_len(kept_bytes).map_err(fail)?;
        let mut sieve = Sieve::default();
        for line in read_log(BufReader::new(file)) {
            if let Ok(record) = line.map_err(fail)?.record {
                sieve.learn(&record);
            }
        }
        let writer = LogWriter::open(&path)?;
        self.open = Some(OpenLog { name: name.into(), writer, kept_bytes, sieve });
        Ok(())
    }

    /// The log that is taken.
    pub(super) fn log(&mut self) -> Option<&mut OpenLog> {
        self.open.as_mut()
    }

    /// Puts a record into the log that is taken.
    pub(super) fn put(&mut self, record: &Record, line: &[u8]) -> Result<(), ShelfError> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let put = open.writer.append_line(line, record);
        open.kept_bytes += line.len() as u64 + 1;
        if put.is_err() {
            // It is opened again, and cut to what is in the ledger.
            self.open = None;
        }
        Ok(put?)
    }

    /// Brings the log that is taken to the disk, and then how far it was.
    pub(super) fn keep(&mut self) -> Result<(), ShelfError> {
        let Some(OpenLog { name, writer, kept_bytes, sieve }) = &mut self.open else {
            return Ok(());
        };
        let taken = Taken { bytes: sieve.taken(), kept_bytes: *kept_bytes, sha256: sieve.sha256() };
        if self.ledger.logs.get(name) == Some(&taken) {
            return Ok(());
        }
        let before = self.ledger.logs.insert(name.clone(), taken);
        let kept = writer.sync().map_err(ShelfError::from).and_then(|()| {
            let written = self.ledger.write(&self.folder);
            written.map_err(|error| ShelfError::of(&self.folder, &error))
        });
        if kept.is_err() {
            match before {
                Some(before) => drop(self.ledger.logs.insert(name.clone(), before)),
                None => drop(self.ledger.logs.remove(name)),
            }
            self.open = None;
        }
        kept
    }
}

/// Refuses a place that another robot was at before, unless this one is known already.
fn no_other_before(root: &Path, robot: &str, address: &str) -> Result<(), ShelfError> {
    let folders = fs::read_dir(root).map_err(|error| ShelfError::of(root, &error))?;
    let ledgers = folders.filter_map(|folder| Ledger::read(&folder.ok()?.path()).ok()?);
    let mut others = ledgers.filter(|other| other.address == address && other.robot != robot);
    match others.next() {
        None => Ok(()),
        Some(before) => Err(ShelfError::new(
            format!("{robot} answers where {} was before", before.robot),
            &format!(
                "if it is another robot, name it: {robot}={address}; if it was renamed, rename its folder too"
            ),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_a_daemon_logs_to_is_refused_also_deeper_in_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let log = folder.path().join("sonard-20260101T000000Z.jsonl");
        let deep = folder.path().join("a/b");
        Shelf::check_root(&deep).expect("no log is there");
        fs::write(&log, "").expect("writes");
        Shelf::check_root(&deep).expect("nobody writes it");
        assert!(Shelf::check_root(folder.path()).is_err(), "a folder of logs");
        let _writer = LogWriter::open(&log).expect("opens");
        assert!(Shelf::check_root(&deep).is_err(), "within one that is written to");
    }

    #[test]
    fn a_place_of_another_robot_wants_the_new_one_to_be_named() {
        let root = tempfile::tempdir().expect("a folder");
        let root = root.path();
        let open = |robot: &str, address: &str, was_named| {
            let mut shelf = Shelf::open(root, robot, address, was_named)?;
            shelf.confirm()?;
            Ok::<_, ShelfError>(shelf)
        };
        let kiwi = open("kiwi", "h:1", false).expect("the first");
        let error = open("kiwi", "h:1", false).expect_err("it is written to");
        assert!(error.message.contains("another process"), "{error}");
        drop(kiwi);
        drop(Shelf::open(root, "kiwi", "h:9", false).expect("somebody who says so"));
        open("kiwi", "h:2", false).expect("it moved");
        open("lime", "h:1", false).expect("nobody is there any more");
        open("mango", "h:9", false).expect("who only said so was never there");
        let error = open("plum", "h:2", false).expect_err("kiwi was there");
        assert!(error.message.contains("where kiwi was") && error.help.contains("plum=h:2"));
        open("plum", "h:2", true).expect("it was named");
    }
}
