//! Writer that appends records to a log.

use std::{
    io,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use sonard_records::{Record, encode_line};

use super::{
    Displacement, LogOutput, PipeOutput, StoreError,
    open::{Recovered, open_file},
    scenes::SceneStore,
};

/// Default maximum time between append and sync of a record while records follow.
pub const SYNC_INTERVAL: Duration = Duration::from_secs(2);

/// Writer of a log: each record is one line and one write.
///
/// Records are durable after the next sync. A sync follows the end of a scan,
/// [`close`](Self::close), and the [`SYNC_INTERVAL`] of the oldest unsynced record, which
/// [`append`](Self::append) and [`sync_if_due`](Self::sync_if_due) check. A killed process loses no
/// appended record; a power failure loses the unsynced ones.
#[derive(Debug)]
pub struct LogWriter<M: LogOutput = Box<dyn LogOutput + Send>> {
    medium: M,
    path: PathBuf,
    line: Vec<u8>,
    interval: Duration,
    /// Time at which the oldest unsynced record was appended.
    unsynced_since: Option<Instant>,
    appended: u64,
    synced: u64,
    failed: bool,
    recovered: Option<Recovered>,
    scenes: SceneStore,
}

impl LogWriter {
    /// Opens and locks a log for appending, or creates it.
    ///
    /// A torn last line is repaired first: its bytes are moved to a separate file, and a `gap`
    /// event records the loss; see [`recovered`](Self::recovered).
    ///
    /// # Errors
    /// Returns an error if the file cannot be opened, another process has locked it, or the repair
    /// fails.
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

    /// Creates a writer to standard output.
    #[must_use]
    pub fn stdout() -> Self {
        Self::new(Box::new(PipeOutput(io::stdout())), Path::new("standard output"))
    }
}

impl<M: LogOutput> LogWriter<M> {
    /// Creates a writer to `medium`; `path` names it in errors.
    pub fn new(medium: M, path: &Path) -> Self {
        Self {
            medium,
            path: path.into(),
            line: Vec::with_capacity(1024),
            interval: SYNC_INTERVAL,
            unsynced_since: None,
            appended: 0,
            synced: 0,
            failed: false,
            recovered: None,
            scenes: SceneStore::default(),
        }
    }

    /// Sets the interval between syncs.
    #[must_use]
    pub fn with_sync_interval(mut self, interval: Duration) -> Self {
        self.interval = interval;
        self
    }

    /// Stores scenes that are too long for a line in the log's folder.
    #[must_use]
    pub fn with_scene_folder(mut self) -> Self {
        self.scenes = SceneStore::in_folder_of(&self.path);
        self
    }

    /// Appends a record, and syncs at the end of a scan or if a sync is due.
    ///
    /// # Errors
    /// After [`StoreError::Record`] and [`StoreError::Write`] no part of the record is in the log
    /// and further records can be appended; any other error is final.
    pub fn append(&mut self, record: &Record) -> Result<(), StoreError> {
        self.append_at(record, Instant::now())
    }

    /// Appends a record at a given time; see [`append`](Self::append).
    ///
    /// # Errors
    /// Returns the errors of [`append`](Self::append).
    pub fn append_at(&mut self, record: &Record, now: Instant) -> Result<(), StoreError> {
        self.check_usable()?;
        self.line.clear();
        let shorter = self.scenes.without_text(record)?;
        encode_line(shorter.as_ref().unwrap_or(record), &mut self.line)
            .map_err(|source| StoreError::Record { path: self.path.clone(), source })?;
        self.write_line()?;
        self.scenes.record_written(record);
        self.appended += 1;
        self.unsynced_since.get_or_insert(now);
        if matches!(record, Record::ScanEnd(_)) { self.sync() } else { self.sync_if_due(now) }
    }

    /// Appends a record by its line from another log, without the newline, which preserves fields
    /// of later versions. The caller must call [`sync`](Self::sync).
    ///
    /// # Errors
    /// Returns the errors of [`append`](Self::append).
    pub fn append_line(&mut self, line: &[u8], record: &Record) -> Result<(), StoreError> {
        self.check_usable()?;
        self.line.clear();
        self.line.extend_from_slice(line);
        self.line.push(b'\n');
        self.write_line()?;
        self.scenes.record_written(record);
        self.appended += 1;
        Ok(())
    }

    /// Syncs if the interval of the oldest unsynced record has elapsed. Needed by callers whose
    /// records may cease.
    ///
    /// # Errors
    /// Returns the errors of [`sync`](Self::sync).
    pub fn sync_if_due(&mut self, now: Instant) -> Result<(), StoreError> {
        match self.unsynced_since {
            Some(since) if now.saturating_duration_since(since) >= self.interval => self.sync(),
            _ => Ok(()),
        }
    }

    /// Syncs all appended records.
    ///
    /// # Errors
    /// Returns [`StoreError::Sync`], after which the log must be reopened: the system may have
    /// dropped unwritten data, which a later sync would not report.
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
        self.unsynced_since = None;
        Ok(())
    }

    /// Syncs and closes the log. A removed file is written again.
    ///
    /// # Errors
    /// Returns the errors of [`sync`](Self::sync), and [`StoreError::Displaced`] if the path does
    /// not name a file with the written records.
    pub fn close(mut self) -> Result<(), StoreError> {
        self.sync()?;
        // Ignores paths that cannot be examined.
        let Ok(Some(displacement)) = self.displacement() else { return Ok(()) };
        if displacement == Displacement::Removed && self.medium.restore(&self.path).is_ok() {
            tracing::warn!("{} was removed and is written again", self.path.display());
            return Ok(());
        }
        Err(StoreError::Displaced { path: self.path.clone(), displacement })
    }

    /// Output of the writer, for operations after the last record.
    pub fn output_mut(&mut self) -> &mut M {
        &mut self.medium
    }

    /// Line of the last appended record, with its newline.
    pub(super) fn last_line(&self) -> &[u8] {
        &self.line
    }

    /// Removes lines that occur in `lines` from the end of the log; returns its new length, bytes.
    pub(super) fn withdraw(&mut self, lines: &[u8]) -> io::Result<u64> {
        self.medium.withdraw(lines)
    }

    /// Returns those of the given lines that the log does not contain.
    pub(super) fn missing(&self, lines: &[u8]) -> io::Result<Vec<u8>> {
        self.medium.missing(lines)
    }

    /// Compares the open file with the file at the log's path.
    ///
    /// # Errors
    /// Returns an error if file or path cannot be examined.
    pub fn displacement(&self) -> io::Result<Option<Displacement>> {
        self.medium.displacement(&self.path)
    }

    /// Number of records appended by this writer.
    #[must_use]
    pub fn appended(&self) -> u64 {
        self.appended
    }

    /// Number of synced records.
    #[must_use]
    pub fn synced(&self) -> u64 {
        self.synced
    }

    /// Repair made at the end of an existing log.
    #[must_use]
    pub fn recovered(&self) -> Option<&Recovered> {
        self.recovered.as_ref()
    }

    /// Path that names the log in errors.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn check_usable(&self) -> Result<(), StoreError> {
        if self.failed { Err(StoreError::Failed { path: self.path.clone() }) } else { Ok(()) }
    }

    /// Writes `self.line` completely or removes the written part.
    ///
    /// Normally one write. After a partial write the rest is retried once more to obtain the
    /// system's error.
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
            _ if self.medium.remove_last(written as u64).is_ok() => {
                Err(StoreError::Write { path, source })
            }
            _ => {
                self.failed = true;
                Err(StoreError::Torn { path, source })
            }
        }
    }
}

impl<M: LogOutput> Drop for LogWriter<M> {
    fn drop(&mut self) {
        // Errors cannot be returned here; callers use close() to receive them.
        if !self.failed {
            let _ = self.sync();
        }
    }
}
