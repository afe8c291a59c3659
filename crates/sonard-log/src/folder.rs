//! Folder of logs with rotation: every file starts with a session and contains complete scans.

mod replacement;
mod retained;

use std::{
    fs::{self, File},
    io::{self, BufReader},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use jiff::{Timestamp, tz::TimeZone};
use sonard_records::{Event, EventKind, Record, Session};

use super::{
    Displacement, LogWriter, StoreError, platform::read_exact_at, read_log, sync::sync_folder_of,
};

use replacement::Replacement;
use retained::RetainedLines;

/// Folder within a collection that holds its accepted scans.
pub const COLLECTED_SCANS: &str = "scans";

const PREFIX: &str = "sonard-";
const SUFFIX: &str = ".jsonl";

/// Limits for starting a new file and removing old ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation {
    /// Maximum size of a file before rotation, bytes.
    pub max_bytes: u64,
    /// Rotation at each change of the day (UTC).
    pub daily: bool,
    /// Total size above which the oldest files are removed, bytes; 0 keeps all files.
    pub keep_bytes: u64,
    /// Maximum time between append and sync of a record.
    pub sync_interval: Duration,
}

/// Log in a folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogFile {
    /// File name within the folder.
    pub name: String,
    /// File size, bytes.
    pub bytes: u64,
}

/// Writer of a folder of logs. Rotation never splits a scan, and each new file starts with a
/// session record.
#[derive(Debug)]
pub struct LogFolder {
    folder: PathBuf,
    rotation: Rotation,
    path: PathBuf,
    /// Open writer; `None` after an error, until the log is reopened.
    writer: Option<LogWriter>,
    day: String,
    session: Option<Box<Session>>,
    /// `true` while the file has no scan, which excludes rotation.
    has_no_scan: bool,
    /// `true` while the file lacks the current session.
    lacks_session: bool,
    /// Lines that are written again if the file is removed or truncated.
    retained: RetainedLines,
    /// Abandoned file, until a new one has its beginning.
    replacement: Option<Replacement>,
    /// Appended and synced records of earlier files.
    appended_before: u64,
    synced_before: u64,
    /// Records of earlier files whose sync was never confirmed.
    uncertain: u64,
    /// `true` if the file was moved during the current scan.
    is_displaced: bool,
    /// Description of the last replacement of a log.
    incident: Option<String>,
}

/// Lists the logs of a folder, oldest first.
///
/// # Errors
/// Returns an error if the folder cannot be read.
pub fn log_files(folder: &Path) -> io::Result<Vec<LogFile>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let Ok(name) = entry.file_name().into_string() else { continue };
        if name.starts_with(PREFIX) && name.ends_with(SUFFIX) {
            // Skips a file that was removed in the meantime.
            let Ok(metadata) = entry.metadata() else { continue };
            // Skips links: logs of this program are regular files.
            if !metadata.is_file() {
                continue;
            }
            files.push(LogFile { name, bytes: metadata.len() });
        }
    }
    files.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(files)
}

impl LogFolder {
    /// Opens the newest log of a folder, which is created if missing. A torn end is repaired, and
    /// an event marks an interrupted scan.
    ///
    /// # Errors
    /// Returns an error if folder or log cannot be opened, or another process writes the log.
    pub fn open(folder: &Path, rotation: Rotation, now: Timestamp) -> Result<Self, StoreError> {
        let fail = |source| StoreError::Open { path: folder.into(), source };
        fs::create_dir_all(folder).map_err(fail)?;
        let newest = log_files(folder).map_err(fail)?.pop();
        let continued =
            newest.map(|file| file.name).filter(|name| !is_of_other_format(&folder.join(name)));
        let path = folder.join(continued.unwrap_or_else(|| file_name(folder, now)));
        let day = path.file_name().map(|name| day_of(&name.to_string_lossy())).unwrap_or_default();
        let mut log = Self {
            folder: folder.into(),
            rotation,
            path,
            writer: None,
            day,
            session: None,
            has_no_scan: true,
            lacks_session: false,
            retained: RetainedLines::default(),
            replacement: None,
            appended_before: 0,
            synced_before: 0,
            uncertain: 0,
            is_displaced: false,
            incident: None,
        };
        log.writer(now)?;
        log.has_no_scan = fs::metadata(&log.path).map_err(fail)?.len() == 0;
        if ends_within_scan(&log.path).map_err(fail)? {
            let detail = "the program ended within the previous scan".to_owned();
            let event = Event { time: now, kind: EventKind::Gap, detail };
            let (writer, _) = log.writer(now)?;
            writer.append(&Record::Event(event))?;
            writer.sync()?;
        }
        Ok(log)
    }

    /// Appends a record. Before a scan or a session, a rotation is carried out if due.
    ///
    /// # Errors
    /// After [`StoreError::Sync`] the record is in the log but may not be on the disk. After any
    /// other error the record is not in the log and can be appended again: the log is then
    /// reopened and its end repaired.
    pub fn append(&mut self, record: &Record, now: Timestamp) -> Result<(), StoreError> {
        let begins = matches!(record, Record::ScanStart(_));
        if begins || matches!(record, Record::Session(_)) {
            self.inspect(now)?;
            self.rotate_if_due(now)?;
            if begins && self.lacks_session {
                self.put_session(now)?;
            }
        }
        let outcome = self.write(record, now);
        if matches!(outcome, Ok(()) | Err(StoreError::Sync { .. })) {
            match record {
                Record::Session(session) => {
                    (self.session, self.lacks_session) = (Some(session.clone()), false);
                }
                Record::ScanStart(_) => self.has_no_scan = false,
                Record::Ping(_) | Record::ScanEnd(_) | Record::Event(_) => {}
            }
        }
        outcome
    }

    /// Syncs if the sync interval of a record has elapsed. Needed by callers whose records may
    /// cease.
    ///
    /// # Errors
    /// Returns the errors of [`LogWriter::sync`].
    pub fn sync_if_due(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let outcome = self.writer(now)?.0.sync_if_due(Instant::now());
        self.handle_failure(outcome, now)
    }

    /// Sets new limits, effective from the next scan.
    pub fn set_rotation(&mut self, rotation: Rotation) {
        self.rotation = rotation;
    }

    /// Path of the current log.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of records appended since the folder was opened.
    #[must_use]
    pub fn appended(&self) -> u64 {
        self.appended_before + self.writer.as_ref().map_or(0, LogWriter::appended)
    }

    /// Number of synced records among the [`appended`](Self::appended) ones.
    #[must_use]
    pub fn synced(&self) -> u64 {
        self.synced_before + self.writer.as_ref().map_or(0, LogWriter::synced)
    }

    /// Number of [`appended`](Self::appended) records that cannot be confirmed: their sync failed,
    /// or their file was removed or changed.
    #[must_use]
    pub const fn uncertain(&self) -> u64 {
        self.uncertain
    }

    /// Syncs and closes the log, after a last [`inspect`](Self::inspect).
    ///
    /// # Errors
    /// Returns the errors of [`LogWriter::sync`] and [`inspect`](Self::inspect).
    pub fn close(&mut self, now: Timestamp) -> Result<(), StoreError> {
        self.inspect(now)?;
        if self.replacement.is_some() {
            self.begin_replacement(now)?;
        }
        let outcome = self.writer.as_mut().map_or(Ok(()), LogWriter::sync);
        drop(self.release_writer());
        outcome
    }

    fn write(&mut self, record: &Record, now: Timestamp) -> Result<(), StoreError> {
        let (writer, retained) = self.writer(now)?;
        let outcome = writer.append(record);
        if matches!(outcome, Ok(()) | Err(StoreError::Sync { .. })) {
            retained.push(writer.last_line(), record);
        }
        self.handle_failure(outcome, now)
    }

    /// Writer of the current file, which is opened if needed, and the lines to be written again.
    fn writer(
        &mut self,
        now: Timestamp,
    ) -> Result<(&mut LogWriter, &mut RetainedLines), StoreError> {
        // A file with records that was removed while it was closed is replaced.
        let is_closed = self.writer.is_none() && self.replacement.is_none();
        if is_closed && !self.has_no_scan && self.lacks_file() {
            let detail = format!("{} {}", self.file_name(), Displacement::Removed);
            self.replace(detail, Some(Displacement::Removed), now);
        }
        if self.replacement.is_some() {
            self.begin_replacement(now)?;
        }
        let writer = match self.writer.take() {
            Some(writer) => writer,
            None => self.open_writer()?,
        };
        Ok((self.writer.insert(writer), &mut self.retained))
    }

    /// Returns `true` if no file has the current path.
    fn lacks_file(&self) -> bool {
        fs::symlink_metadata(&self.path).is_err_and(|error| error.kind() == io::ErrorKind::NotFound)
    }

    fn open_writer(&self) -> Result<LogWriter, StoreError> {
        let writer = LogWriter::open(&self.path)?;
        Ok(writer.with_sync_interval(self.rotation.sync_interval).with_scene_folder())
    }

    /// Closes a log that rejects further records. After a failed sync a new file is started, since
    /// a later sync of the old one does not cover earlier records. After a torn record the log is
    /// reopened and repaired, if it is still in place.
    fn handle_failure(
        &mut self,
        outcome: Result<(), StoreError>,
        now: Timestamp,
    ) -> Result<(), StoreError> {
        use StoreError::{Failed, Sync, Torn};
        let Err(error) = &outcome else { return outcome };
        let displacement =
            self.writer.as_ref().and_then(|writer| writer.displacement().ok().flatten());
        match error {
            Sync { source, unsynced, .. } => {
                let file = self.file_name();
                let detail = format!(
                    "{file} could not be synced ({source}): its last {unsynced} record(s) may not be on \
                     the disk"
                );
                self.replace(detail, displacement, now);
            }
            Torn { .. } | Failed { .. } => match displacement {
                Some(displacement @ (Displacement::Removed | Displacement::Moved)) => {
                    let detail = format!("{} {displacement}", self.file_name());
                    self.replace(detail, Some(displacement), now);
                }
                _ => drop(self.release_writer()),
            },
            _ => {}
        }
        outcome
    }

    /// Takes the open writer and adds its counts to the totals; the file is closed unless the
    /// caller keeps it.
    fn release_writer(&mut self) -> Option<LogWriter> {
        let writer = self.writer.take()?;
        self.appended_before += writer.appended();
        self.synced_before += writer.synced();
        Some(writer)
    }

    /// Repeats the current session in a file that lacks one; retried with the next scan after a
    /// failure.
    fn put_session(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let Some(session) = self.session.clone() else { return Ok(()) };
        match self.write(&Record::Session(session), now) {
            Ok(()) => {
                self.lacks_session = false;
                Ok(())
            }
            Err(StoreError::Sync { path, .. }) => {
                self.lacks_session = false;
                // The session is in the log, but the following record is not; `Sync` would
                // indicate the opposite.
                Err(StoreError::Failed { path })
            }
            Err(error) => Err(error),
        }
    }

    /// Starts a new file if size or day require it.
    fn rotate_if_due(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let bytes = fs::metadata(&self.path).map_or(0, |metadata| metadata.len());
        let too_old = self.rotation.daily && self.day != day(now);
        let is_due = bytes > self.rotation.max_bytes || too_old;
        let is_between_files = self.has_no_scan || self.replacement.is_some();
        if !is_due || is_between_files || self.retained.is_in_scan() {
            return Ok(());
        }
        if let Some(writer) = &mut self.writer {
            let synced = writer.sync();
            let path = self.path.clone();
            // The following record is not in any log; `Sync` would indicate the opposite.
            self.handle_failure(synced, now).map_err(|_| StoreError::Failed { path })?;
            drop(self.release_writer());
        }
        self.retained.restart();
        self.name_next_file(now);
        self.writer(now)?;
        self.remove_oldest();
        Ok(())
    }

    /// Chooses the name of the next file and resets its state.
    fn name_next_file(&mut self, now: Timestamp) {
        self.path = self.folder.join(file_name(&self.folder, now));
        (self.day, self.has_no_scan, self.lacks_session) = (day(now), true, true);
    }

    /// Removes the oldest logs above the size limit, but never the current one.
    fn remove_oldest(&self) {
        if self.rotation.keep_bytes == 0 {
            return;
        }
        let Ok(files) = log_files(&self.folder) else { return };
        let mut total: u64 = files.iter().map(|file| file.bytes).sum();
        for file in files.iter().take(files.len().saturating_sub(1)) {
            if total <= self.rotation.keep_bytes {
                break;
            }
            // A failed removal is retried at the next rotation.
            if fs::remove_file(self.folder.join(&file.name)).is_ok() {
                total -= file.bytes;
            }
        }
        // A failed sync may at worst restore removed files after a power failure.
        let _ = sync_folder_of(&self.path);
    }
}

/// Returns `true` if the first line of a log is a session of another format. Readers reject such a
/// file, so nothing may be appended to it.
fn is_of_other_format(log: &Path) -> bool {
    let Ok(file) = File::open(log) else { return false };
    let first = read_log(BufReader::new(file)).next().and_then(Result::ok);
    first
        .and_then(|line| line.record.err())
        .is_some_and(|error| error.reject_other_format(log).is_err())
}

fn day(now: Timestamp) -> String {
    now.to_zoned(TimeZone::UTC).strftime("%Y%m%d").to_string()
}

/// Extracts the day from a log's name.
fn day_of(name: &str) -> String {
    name.strip_prefix(PREFIX).and_then(|rest| rest.get(..8)).unwrap_or_default().to_owned()
}

/// Chooses an unused name that sorts after all others in the folder.
fn file_name(folder: &Path, now: Timestamp) -> String {
    let time = now.to_zoned(TimeZone::UTC).strftime("%Y%m%dT%H%M%SZ").to_string();
    let newest = log_files(folder).ok().and_then(|mut files| files.pop()).map(|file| file.name);
    let first = format!("{PREFIX}{time}{SUFFIX}");
    match newest {
        // The clock was set back, or two files start within one second: numbers the newest name.
        Some(newest) if newest >= first => {
            let stem = newest.trim_end_matches(SUFFIX);
            let (stem, number) = stem.split_once('_').unwrap_or((stem, "0"));
            let number = number.parse::<u32>().unwrap_or(0) + 1;
            format!("{stem}_{number:06}{SUFFIX}")
        }
        _ => first,
    }
}

/// Returns `true` if the last scan of a log has no end. The file is searched backwards.
fn ends_within_scan(path: &Path) -> io::Result<bool> {
    const START: &[u8] = b"{\"type\":\"scan_start\"";
    const END: &[u8] = b"{\"type\":\"scan_end\"";
    const CHUNK: u64 = 1 << 16;
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut end = length;
    while end > 0 {
        let start = end.saturating_sub(CHUNK);
        // The overlap finds a match across the chunk boundary.
        let stop = (end + START.len() as u64).min(length);
        let mut bytes = vec![0; (stop - start) as usize];
        read_exact_at(&file, &mut bytes, start)?;
        let last = |what: &[u8]| bytes.windows(what.len()).rposition(|window| window == what);
        match (last(START), last(END)) {
            (None, None) => end = start,
            (began, ended) => return Ok(began > ended),
        }
    }
    Ok(false)
}
