//! A folder of logs: one is written, full ones are left behind, whole sessions in each.

mod replacement;

use std::{
    fs::{self, File},
    io::{self, BufReader},
    os::unix::fs::FileExt as _,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use jiff::{Timestamp, tz::TimeZone};
use sonard_records::{Event, EventKind, Record, ScanStart, Session};

use super::{LogWriter, StoreError, read_log, sync::sync_folder_of};

use replacement::Replacement;

const PREFIX: &str = "sonard-";
const SUFFIX: &str = ".jsonl";

/// When another file is begun and old ones go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation {
    /// Begin another file when this one is larger, bytes.
    pub max_bytes: u64,
    /// Begin another file each day (UTC).
    pub daily: bool,
    /// Remove the oldest when all together are larger, bytes; 0 keeps everything.
    pub keep_bytes: u64,
    /// How long a record may wait for the disk.
    pub sync_interval: Duration,
}

/// One log of a folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogFile {
    /// Its name in the folder.
    pub name: String,
    /// Its size, bytes.
    pub bytes: u64,
}

/// Writes the newest log of a folder and begins another when it is time, always with a
/// session's record first, never within a scan.
#[derive(Debug)]
pub struct LogFolder {
    folder: PathBuf,
    rotation: Rotation,
    path: PathBuf,
    /// Not there after an error that it did not survive; then it is opened anew.
    writer: Option<LogWriter>,
    day: String,
    session: Option<Box<Session>>,
    /// No scan is in the log yet: it has no reason to end.
    fresh: bool,
    /// Whether the file lacks the session in force.
    bare: bool,
    /// Where the scan under way begins in the file, bytes, with its first record.
    scan: Option<(u64, Box<ScanStart>)>,
    /// Gaps that the next file begins with: the present one can't be continued.
    replacement: Option<Replacement>,
    /// Records of earlier files: appended, and of those, on the disk for good.
    appended_before: u64,
    synced_before: u64,
    /// Records of earlier files that will never be confirmed to be on the disk.
    uncertain: u64,
    /// The file was moved during the scan under way.
    is_displaced: bool,
    /// Report of a log that had to be replaced.
    incident: Option<String>,
}

/// The logs of a folder, oldest first.
///
/// # Errors
/// When the folder can't be read.
pub fn log_files(folder: &Path) -> io::Result<Vec<LogFile>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let Ok(name) = entry.file_name().into_string() else { continue };
        if name.starts_with(PREFIX) && name.ends_with(SUFFIX) {
            // A file that is removed at this moment is none.
            let Ok(metadata) = entry.metadata() else { continue };
            // A link is not followed: a log is what this program wrote here itself.
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
    /// Goes on with the newest log of a folder (which is made if it isn't there): its torn end
    /// is mended, and a scan that it broke off in is marked by an event.
    ///
    /// # Errors
    /// When the folder or the log can't be opened, or another process writes it.
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
            fresh: false,
            bare: false,
            scan: None,
            replacement: None,
            appended_before: 0,
            synced_before: 0,
            uncertain: 0,
            is_displaced: false,
            incident: None,
        };
        log.writer(now)?;
        log.fresh = fs::metadata(&log.path).map_err(fail)?.len() == 0;
        if ends_within_scan(&log.path).map_err(fail)? {
            let detail = "the program ended within the scan before this".to_owned();
            let event = Event { time: now, kind: EventKind::Gap, detail };
            let writer = log.writer(now)?;
            writer.append(&Record::Event(event))?;
            writer.sync()?;
        }
        Ok(log)
    }

    /// Appends one record; before a scan or a session another file is begun if it is time.
    ///
    /// # Errors
    /// After [`StoreError::Sync`] the record is in the log, though not safely. After any other
    /// error it is not, and can be given again: a log that did not survive is opened anew, and
    /// its end mended.
    pub fn append(&mut self, record: &Record, now: Timestamp) -> Result<(), StoreError> {
        let begins = matches!(record, Record::ScanStart(_));
        if begins || matches!(record, Record::Session(_)) {
            self.inspect(now)?;
            self.rotate_if_due(now)?;
            if begins && self.bare {
                self.put_session(now)?;
            }
        }
        let offset = self.writer(now)?.length();
        let outcome = self.put(record, now);
        if matches!(outcome, Ok(()) | Err(StoreError::Sync { .. })) {
            match record {
                Record::Session(session) => {
                    (self.session, self.bare) = (Some(session.clone()), false);
                }
                Record::ScanStart(start) => {
                    self.scan = Some((offset, Box::new(start.clone())));
                    self.fresh = false;
                }
                Record::ScanEnd(_) => self.scan = None,
                Record::Ping(_) | Record::Event(_) => {}
            }
        }
        outcome
    }

    /// Syncs if a record has waited for long enough. For callers whose records may stop coming.
    ///
    /// # Errors
    /// As [`LogWriter::sync`].
    pub fn sync_if_due(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let outcome = self.writer(now)?.sync_if_due(Instant::now());
        self.survive(outcome)
    }

    /// Other limits from the next scan on.
    pub fn set_rotation(&mut self, rotation: Rotation) {
        self.rotation = rotation;
    }

    /// The log that is being written.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Records appended since the folder was opened.
    #[must_use]
    pub fn appended(&self) -> u64 {
        self.appended_before + self.writer.as_ref().map_or(0, LogWriter::appended)
    }

    /// Records that are on the disk for good, of those [`appended`](Self::appended).
    #[must_use]
    pub fn synced(&self) -> u64 {
        self.synced_before + self.writer.as_ref().map_or(0, LogWriter::synced)
    }

    /// Records that will never be confirmed, of those [`appended`](Self::appended): their sync failed, or their file was
    /// removed or changed.
    #[must_use]
    pub const fn uncertain(&self) -> u64 {
        self.uncertain
    }

    /// Syncs and lets go of the log.
    ///
    /// # Errors
    /// As [`LogWriter::sync`].
    pub fn close(&mut self) -> Result<(), StoreError> {
        let outcome = self.writer.as_mut().map_or(Ok(()), LogWriter::sync);
        self.release_writer();
        outcome
    }

    fn put(&mut self, record: &Record, now: Timestamp) -> Result<(), StoreError> {
        let outcome = self.writer(now)?.append(record);
        self.survive(outcome)
    }

    fn writer(&mut self, now: Timestamp) -> Result<&mut LogWriter, StoreError> {
        if self.replacement.is_some() {
            self.begin_replacement(now)?;
        }
        let writer = match self.writer.take() {
            Some(writer) => writer,
            None => self.open_writer()?,
        };
        Ok(self.writer.insert(writer))
    }

    fn open_writer(&self) -> Result<LogWriter, StoreError> {
        let writer = LogWriter::open(&self.path)?;
        Ok(writer.with_sync_interval(self.rotation.sync_interval).with_scenes_beside())
    }

    /// Lets go of a log that takes no more records. After a failed sync another file is begun, since a later sync of
    /// this one proves nothing about what was written before; after a torn record its end is mended.
    fn survive(&mut self, outcome: Result<(), StoreError>) -> Result<(), StoreError> {
        use StoreError::{Failed, Sync, Torn};
        match &outcome {
            Err(Sync { source, unsynced, .. }) => {
                let file = self.file_name();
                let detail = format!(
                    "{file} could not be synced ({source}): its last {unsynced} record(s) may not be on the disk"
                );
                self.replace(detail, Vec::new());
            }
            Err(Torn { .. } | Failed { .. }) => self.release_writer(),
            _ => {}
        }
        outcome
    }

    /// Closes the file and takes over its counts.
    fn release_writer(&mut self) {
        if let Some(writer) = self.writer.take() {
            self.appended_before += writer.appended();
            self.synced_before += writer.synced();
        }
    }

    /// Repeats the session in force in a file that lacks it. Until that has succeeded the file
    /// stays bare, so that another try does not leave it out.
    fn put_session(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let Some(session) = self.session.clone() else { return Ok(()) };
        match self.put(&Record::Session(session), now) {
            Ok(()) => {
                self.bare = false;
                Ok(())
            }
            Err(StoreError::Sync { path, .. }) => {
                self.bare = false;
                // The session is in the log; the record that is to follow is not, which `Sync`
                // would say.
                Err(StoreError::Failed { path })
            }
            Err(error) => Err(error),
        }
    }

    /// Begins another file if it is time.
    fn rotate_if_due(&mut self, now: Timestamp) -> Result<(), StoreError> {
        let bytes = fs::metadata(&self.path).map_or(0, |metadata| metadata.len());
        let too_old = self.rotation.daily && self.day != day(now);
        if self.scan.is_some() || self.fresh || !(bytes > self.rotation.max_bytes || too_old) {
            return Ok(());
        }
        if let Some(writer) = &mut self.writer {
            let synced = writer.sync();
            let path = self.path.clone();
            // The record that is to follow is not in any log yet, which `Sync` would say.
            self.survive(synced).map_err(|_| StoreError::Failed { path })?;
            self.release_writer();
        }
        self.name_next_file(now);
        self.writer(now)?;
        self.remove_oldest();
        Ok(())
    }

    /// Names the next file, which has no session yet.
    fn name_next_file(&mut self, now: Timestamp) {
        self.path = self.folder.join(file_name(&self.folder, now));
        (self.day, self.fresh, self.bare) = (day(now), true, true);
    }

    /// Removes the oldest logs as far as the limit asks for it, never the one being written.
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
            // What can't be removed now is tried again at the next file.
            if fs::remove_file(self.folder.join(&file.name)).is_ok() {
                total -= file.bytes;
            }
        }
        // Costs nothing if it fails: the files are gone from the folder all the same.
        let _ = sync_folder_of(&self.path);
    }
}

/// Returns `true` if the first line of a log is a session of another format: readers reject the whole file, so nothing
/// may be appended to it.
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

/// The day in a log's name.
fn day_of(name: &str) -> String {
    name.strip_prefix(PREFIX).and_then(|rest| rest.get(..8)).unwrap_or_default().to_owned()
}

/// A name that sorts behind every other of the folder and is not taken.
fn file_name(folder: &Path, now: Timestamp) -> String {
    let time = now.to_zoned(TimeZone::UTC).strftime("%Y%m%dT%H%M%SZ").to_string();
    let newest = log_files(folder).ok().and_then(|mut files| files.pop()).map(|file| file.name);
    let first = format!("{PREFIX}{time}{SUFFIX}");
    match newest {
        // The clock was set back, or this is the second file of a second: go on from the newest.
        Some(newest) if newest >= first => {
            let stem = newest.trim_end_matches(SUFFIX);
            let (stem, number) = stem.split_once('_').unwrap_or((stem, "0"));
            let number = number.parse::<u32>().unwrap_or(0) + 1;
            format!("{stem}_{number:06}{SUFFIX}")
        }
        _ => first,
    }
}

/// Whether the last record of a scan in the log is not its end, looking from the end of the file.
fn ends_within_scan(path: &Path) -> io::Result<bool> {
    const START: &[u8] = b"{\"type\":\"scan_start\"";
    const END: &[u8] = b"{\"type\":\"scan_end\"";
    const CHUNK: u64 = 1 << 16;
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut end = length;
    while end > 0 {
        let start = end.saturating_sub(CHUNK);
        // Some bytes more, so that nothing is cut in two.
        let stop = (end + START.len() as u64).min(length);
        let mut bytes = vec![0; (stop - start) as usize];
        file.read_exact_at(&mut bytes, start)?;
        let last = |what: &[u8]| bytes.windows(what.len()).rposition(|window| window == what);
        match (last(START), last(END)) {
            (None, None) => end = start,
            (began, ended) => return Ok(began > ended),
        }
    }
    Ok(false)
}
