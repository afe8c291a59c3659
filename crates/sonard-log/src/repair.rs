//! Repair of a damaged log: unreadable lines are removed, and the original is kept.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, BufRead as _, BufReader, BufWriter, Write},
    path::{Path, PathBuf},
};

use sonard_records::{RecordError, RecordErrorKind};

use super::{
    FileKind, Line, LineError, StoreError,
    open::{lock, open_no_follow, with_suffix},
    open_for_reading, read_log,
    sync::{sync_file, sync_folder_of},
};

/// Line removed by a repair.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RemovedLine {
    /// Line number in the original, from 1.
    pub line: u64,
    /// Offset in the original, bytes.
    pub offset: u64,
    /// Length without the newline, bytes.
    pub length: u64,
    /// Fault of the line.
    pub fault: RecordError,
}

/// Result of a repair.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Repair {
    /// Number of records kept byte for byte.
    pub kept: u64,
    /// Removed torn last line, if any.
    pub torn: Option<RemovedLine>,
    /// `true` if the last record was complete and only its newline was added.
    pub newline_added: bool,
    /// Other removed lines.
    pub removed: Vec<RemovedLine>,
    /// Complete records kept byte for byte although this version cannot read them: another version
    /// may.
    pub kept_unread: Vec<LineError>,
    /// Path of the original; `None` if the log was intact.
    pub original: Option<PathBuf>,
}

/// Repairs the log at `path`: complete records are kept byte for byte, other lines removed. The
/// original is kept in the same folder as `<log>.orig` (or `.orig-2`, ...).
///
/// The log is replaced atomically, so a crash leaves either the old or the repaired log. An intact
/// log is not modified.
///
/// # Errors
/// Returns an error if another process has locked the log, or reading or writing fails; the log is
/// then unchanged.
pub fn repair(path: &Path) -> Result<Repair, StoreError> {
    // Follows links, so that the log itself is repaired.
    let path = &fs::canonicalize(path)
        .map_err(|source| StoreError::Unreadable { path: path.into(), source })?;
    // Rejects files of other kinds.
    drop(open_for_reading(path)?);
    let open = |source| StoreError::Open { path: path.clone(), source };
    let file = open_no_follow(OpenOptions::new().read(true), path).map_err(open)?;
    if !file.metadata().map_err(open)?.is_file() {
        return Err(open(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")));
    }
    lock(&file, path)?;
    let draft = RepairDraft::create(path)?;
    let mut repair = Repair::default();
    let mut out = BufWriter::with_capacity(1 << 16, &draft.file);
    for line in read_log(BufReader::with_capacity(1 << 16, &file)) {
        let line = line.map_err(|source| StoreError::Read { path: path.clone(), source })?;
        repair.process(&line, &mut out).map_err(|source| draft.fail(source))?;
    }
    if repair.kept == 0 && repair.kept_unread.is_empty() && !repair.removed.is_empty() {
        // A file without any record is not a log and remains unchanged.
        let kind = open_for_reading(path)?.fill_buf().map_or(FileKind::Binary, FileKind::detect);
        return Err(StoreError::NotALog { path: path.clone(), kind });
    }
    out.flush().map_err(|source| draft.fail(source))?;
    drop(out);
    if repair.has_changes() {
        repair.original = Some(draft.replace(&file, path)?);
    }
    Ok(repair)
}

impl Repair {
    fn process(&mut self, line: &Line, out: &mut impl Write) -> io::Result<()> {
        let fault = match &line.record {
            Ok(_) => {
                self.kept += 1;
                self.newline_added = !line.ended;
                return keep(line, out);
            }
            Err(error) if error.fault.is_complete_object() => {
                self.kept_unread.push(error.clone());
                return keep(line, out);
            }
            Err(error) => error.fault.clone(),
        };
        let torn = fault.kind == RecordErrorKind::Truncated;
        let Line { number, offset, length, .. } = *line;
        let left_out = RemovedLine { line: number, offset, length, fault };
        if torn {
            self.torn = Some(left_out);
        } else {
            self.removed.push(left_out);
        }
        Ok(())
    }

    fn has_changes(&self) -> bool {
        self.torn.is_some() || self.newline_added || !self.removed.is_empty()
    }
}

fn keep(line: &Line, out: &mut impl Write) -> io::Result<()> {
    out.write_all(&line.bytes)?;
    out.write_all(b"\n")
}

/// Repaired log during writing; removed on drop unless it replaced the log.
struct RepairDraft {
    file: File,
    path: PathBuf,
}

impl RepairDraft {
    fn create(log: &Path) -> Result<Self, StoreError> {
        let path = with_suffix(log, &format!(".repair-{}", std::process::id()));
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => Ok(Self { file, path }),
            Err(source) => Err(StoreError::Open { path, source }),
        }
    }

    fn fail(&self, source: io::Error) -> StoreError {
        StoreError::Write { path: self.path.clone(), source }
    }

    /// Links the original under another name and replaces the log by the draft.
    fn replace(&self, original: &File, log: &Path) -> Result<PathBuf, StoreError> {
        let swap = || {
            self.file.set_permissions(original.metadata()?.permissions())?;
            sync_file(&self.file)?;
            let kept = keep_original(log)?;
            sync_folder_of(log)?;
            fs::rename(&self.path, log)?;
            sync_folder_of(log)?;
            Ok(kept)
        };
        swap().map_err(|source| self.fail(source))
    }
}

impl Drop for RepairDraft {
    fn drop(&mut self) {
        // After the rename this file no longer exists.
        let _ = fs::remove_file(&self.path);
    }
}

/// Links the log under the first free name of `.orig`, `.orig-2`, ...
fn keep_original(log: &Path) -> io::Result<PathBuf> {
    let mut n = 1;
    loop {
        let name = if n == 1 { ".orig".into() } else { format!(".orig-{n}") };
        let kept = with_suffix(log, &name);
        match fs::hard_link(log, &kept) {
            Ok(()) => return Ok(kept),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => n += 1,
            // Copies on file systems without hard links.
            Err(_) => {
                let mut copy = OpenOptions::new().write(true).create_new(true).open(&kept)?;
                io::copy(&mut File::open(log)?, &mut copy)?;
                sync_file(&copy)?;
                return Ok(kept);
            }
        }
    }
}
