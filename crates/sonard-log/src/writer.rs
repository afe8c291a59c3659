//! Appends records to a log.

use std::{
    io,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use sonard_records::{Record, encode_line};

use super::{
    Displacement, Medium, Pipe, StoreError,
    open::{Recovered, open_file},
    scenes::SceneKeeper,
};

/// How long a record may wait for the disk while others follow it.
pub const SYNC_INTERVAL: Duration = Duration::from_secs(2);

/// Writes a log: each record as one line with one write.
///
/// A record is on the disk for good after the sync that follows it: at the end of a scan, when
/// [`SYNC_INTERVAL`] has passed since the first record not yet synced (noticed by the next
/// [`append`](Self::append) or [`sync_if_due`](Self::sync_if_due)), and on
/// [`close`](Self::close). A process that is killed loses nothing it appended, only a machine
/// that stops loses what was not synced.
#[derive(Debug)]
pub struct LogWriter<M: Medium = Box<dyn Medium + Send>> {
    medium: M,
    path: PathBuf,
    line: Vec<u8>,
    interval: Duration,
    /// When the oldest record not yet synced was appended.
    waiting_since: Option<Instant>,
    appended: u64,
    synced: u64,
    failed: bool,
    recovered: Option<Recovered>,
    scenes: SceneKeeper,
}

impl LogWriter {
    /// Opens a log for appending, creates it if it isn't there, and locks it.
    ///
    /// An existing log that ends in a torn line is mended first: the torn bytes go to a file
    /// beside it and an event of kind `gap` says so; see [`recovered`](Self::recovered).
    ///
    /// # Errors
    /// When the file can't be opened, another process holds it, or mending fails.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let (medium, recovered) = open_file(path)?;
        let mut writer = Self::new(medium, path);
        if let Some(event) = recovered.as_ref().and_then(Recovered::event) {
            writer.append(&Record::Event(event))?;
            writer.sync()?;
        }
        writer.recovered = recovered;
        Ok(writer)
    }

    /// Writes to standard output.
    #[must_use]
    pub fn stdout() -> Self {
        Self::new(Box::new(Pipe(io::stdout())), Path::new("standard output"))
    }
}

impl<M: Medium> LogWriter<M> {
    /// Writes to `medium`; `path` is what errors call it.
    pub fn new(medium: M, path: &Path) -> Self {
        Self {
            medium,
            path: path.into(),
            line: Vec::with_capacity(1024),
            interval: SYNC_INTERVAL,
            waiting_since: None,
            appended: 0,
            synced: 0,
            failed: false,
            recovered: None,
            scenes: SceneKeeper::default(),
        }
    }

    /// The same with another interval between syncs.
    #[must_use]
    pub fn with_sync_interval(mut self, interval: Duration) -> Self {
        self.interval = interval;
        self
    }

    /// The same, with scenes too long for a line kept in the log's folder.
    #[must_use]
    pub fn with_scenes_beside(mut self) -> Self {
        self.scenes = SceneKeeper::beside(&self.path);
        self
    }

    /// Appends one record, and syncs if it ends a scan or a sync is due.
    ///
    /// # Errors
    /// After [`StoreError::Record`] and [`StoreError::Write`] nothing of the record is in the
    /// log and the next one can be appended; any other error is final.
    pub fn append(&mut self, record: &Record) -> Result<(), StoreError> {
        self.append_at(record, Instant::now())
    }

    /// [`append`](Self::append) with the time given.
    ///
    /// # Errors
    /// As for [`append`](Self::append).
    pub fn append_at(&mut self, record: &Record, now: Instant) -> Result<(), StoreError> {
        self.check_usable()?;
        self.line.clear();
        let shorter = self.scenes.shortened(record)?;
        encode_line(shorter.as_ref().unwrap_or(record), &mut self.line)
            .map_err(|source| StoreError::Record { path: self.path.clone(), source })?;
        self.write_line()?;
        self.scenes.written(record);
        self.appended += 1;
        self.waiting_since.get_or_insert(now);
        if matches!(record, Record::ScanEnd(_)) { self.sync() } else { self.sync_if_due(now) }
    }

    /// Appends a record by its line as it stands in another log, without the newline: with all that a later version may
    /// have put there. It is on the disk for good after the next [`sync`](Self::sync), which is the caller's to ask for.
    ///
    /// # Errors
    /// As for [`append`](Self::append).
    pub fn append_line(&mut self, line: &[u8], record: &Record) -> Result<(), StoreError> {
        self.check_usable()?;
        self.line.clear();
        self.line.extend_from_slice(line);
        self.line.push(b'\n');
        self.write_line()?;
        self.scenes.written(record);
        self.appended += 1;
        Ok(())
    }

    /// Syncs if a record has waited for longer than the interval. For callers whose records may
    /// stop coming.
    ///
    /// # Errors
    /// As for [`sync`](Self::sync).
    pub fn sync_if_due(&mut self, now: Instant) -> Result<(), StoreError> {
        match self.waiting_since {
            Some(since) if now.saturating_duration_since(since) >= self.interval => self.sync(),
            _ => Ok(()),
        }
    }

    /// Brings everything appended to the disk.
    ///
    /// # Errors
    /// [`StoreError::Sync`], after which the log must be opened again: the system may have
    /// dropped what it could not write, and a later sync would not tell.
    pub fn sync(&mut self) -> Result<(), StoreError> {
        self.check_usable()?;
        if self.synced == self.appended {
            return Ok(());
        }
        self.medium.sync().map_err(|source| {
            self.failed = true;
            let unsynced = self.appended - self.synced;
            StoreError::Sync { path: self.path.clone(), source, unsynced }
        })?;
        self.synced = self.appended;
        self.waiting_since = None;
        Ok(())
    }

    /// Syncs and lets go of the log.
    ///
    /// # Errors
    /// As for [`sync`](Self::sync).
    pub fn close(mut self) -> Result<(), StoreError> {
        self.sync()
    }

    /// What it writes to: for what is to happen to it after the last record.
    pub fn medium_mut(&mut self) -> &mut M {
        &mut self.medium
    }

    /// Length of the log by what was written, bytes; 0 where there is none.
    pub(super) fn length(&self) -> u64 {
        self.medium.length()
    }

    /// Everything written from a byte on.
    pub(super) fn read_from(&self, offset: u64) -> io::Result<Vec<u8>> {
        self.medium.read_from(offset)
    }

    /// Deviation of the open file from the one that the log's path names.
    ///
    /// # Errors
    /// When file or path can't be examined.
    pub fn displacement(&self) -> io::Result<Option<Displacement>> {
        self.medium.displacement(&self.path)
    }

    /// Records appended through this writer.
    #[must_use]
    pub fn appended(&self) -> u64 {
        self.appended
    }

    /// Records that are on the disk for good.
    #[must_use]
    pub fn synced(&self) -> u64 {
        self.synced
    }

    /// What was found wrong with the end of an existing log and mended.
    #[must_use]
    pub fn recovered(&self) -> Option<&Recovered> {
        self.recovered.as_ref()
    }

    /// What errors call the log.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn check_usable(&self) -> Result<(), StoreError> {
        if self.failed { Err(StoreError::Failed { path: self.path.clone() }) } else { Ok(()) }
    }

    /// Writes `self.line` whole or leaves nothing of it behind.
    ///
    /// One write is the rule; only when the system takes fewer bytes is the rest offered again,
    /// to learn why.
    fn write_line(&mut self) -> Result<(), StoreError> {
        let mut written = 0;
        let source = loop {
            match self.medium.write(self.line.get(written..).unwrap_or_default()) {
                Ok(0) => break io::ErrorKind::WriteZero.into(),
                Ok(count) => written += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => break error,
            }
            if written == self.line.len() {
                return Ok(());
            }
        };
        let path = self.path.clone();
        match written {
            0 => Err(StoreError::Write { path, source }),
            _ if self.medium.take_back(written as u64).is_ok() => {
                Err(StoreError::Write { path, source })
            }
            _ => {
                self.failed = true;
                Err(StoreError::Torn { path, source })
            }
        }
    }
}

impl<M: Medium> Drop for LogWriter<M> {
    fn drop(&mut self) {
        // close() is the way to learn of an error; here nobody could be told.
        if !self.failed {
            let _ = self.sync();
        }
    }
}
