//! Leaves out of a log what can't be read, and keeps the original.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, BufRead as _, BufReader, BufWriter, Write},
    path::{Path, PathBuf},
};

use sonard_records::{FaultKind, RecordError};

use super::{
    FileKind, Line, LineError, StoreError,
    open::{lock, open_own, with_suffix},
    open_for_reading, read_log,
    sync::{sync_file, sync_folder_of},
};

/// A line that a repair left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// Number of the line in the original, from 1.
    pub line: u64,
    /// Where it begins in the original, bytes.
    pub offset: u64,
    /// How long it is, bytes.
    pub length: u64,
    /// What is wrong with it.
    pub fault: RecordError,
}

/// The result of a repair.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Repair {
    /// Records kept, byte for byte.
    pub kept: u64,
    /// The torn last line, if there was one.
    pub torn: Option<LeftOut>,
    /// The last record was whole and got the newline it lacked.
    pub newline_added: bool,
    /// Other lines left out.
    pub left_out: Vec<LeftOut>,
    /// Whole records kept, byte for byte too, although this program can't read them: another
    /// version may.
    pub kept_unread: Vec<LineError>,
    /// Where the original is; `None` if nothing had to be done.
    pub original: Option<PathBuf>,
}

/// Repairs the log at `path`: every whole record is kept byte for byte, all else left out, the
/// original stays beside it as `<log>.orig` (or `.orig-2`, ...).
///
/// The new file takes the log's place in one step, so that a crash leaves either the old log or
/// the repaired one. A log that needs nothing is not touched.
///
/// # Errors
/// When another process holds the log, or reading or writing fails; the log is then as it was.
pub fn repair(path: &Path) -> Result<Repair, StoreError> {
    // A link to a log is repaired where the log is.
    let path = &fs::canonicalize(path)
        .map_err(|source| StoreError::Unreadable { path: path.into(), source })?;
    // Other files have no records to keep.
    drop(open_for_reading(path)?);
    let open = |source| StoreError::Open { path: path.clone(), source };
    let file = open_own(OpenOptions::new().read(true), path).map_err(open)?;
    if !file.metadata().map_err(open)?.is_file() {
        return Err(open(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file")));
    }
    lock(&file, path)?;
    let draft = Draft::create(path)?;
    let mut repair = Repair::default();
    let mut out = BufWriter::with_capacity(1 << 16, &draft.file);
    for line in read_log(BufReader::with_capacity(1 << 16, &file)) {
        let line = line.map_err(|source| StoreError::Read { path: path.clone(), source })?;
        repair.take(&line, &mut out).map_err(|source| draft.fail(source))?;
    }
    if repair.kept == 0 && repair.kept_unread.is_empty() && !repair.left_out.is_empty() {
        // There is nothing to keep: it is some other file, and stays what it is.
        let kind = open_for_reading(path)?.fill_buf().map_or(FileKind::Binary, FileKind::of);
        return Err(StoreError::NoLog { path: path.clone(), kind });
    }
    out.flush().map_err(|source| draft.fail(source))?;
    drop(out);
    if repair.changes_something() {
        repair.original = Some(draft.replace(&file, path)?);
    }
    Ok(repair)
}

impl Repair {
    fn take(&mut self, line: &Line, out: &mut impl Write) -> io::Result<()> {
        let fault = match &line.record {
            Ok(_) => {
                self.kept += 1;
                self.newline_added = !line.ended;
                return keep(line, out);
            }
            Err(error) if error.fault.is_whole_record() => {
                self.kept_unread.push(error.clone());
                return keep(line, out);
            }
            Err(error) => error.fault.clone(),
        };
        let torn = fault.kind == FaultKind::Torn;
        let Line { number, offset, length, .. } = *line;
        let left_out = LeftOut { line: number, offset, length, fault };
        if torn {
            self.torn = Some(left_out);
        } else {
            self.left_out.push(left_out);
        }
        Ok(())
    }

    fn changes_something(&self) -> bool {
        self.torn.is_some() || self.newline_added || !self.left_out.is_empty()
    }
}

fn keep(line: &Line, out: &mut impl Write) -> io::Result<()> {
    out.write_all(&line.bytes)?;
    out.write_all(b"\n")
}

/// The repaired log while it is being written; removed unless it takes the log's place.
struct Draft {
    file: File,
    path: PathBuf,
}

impl Draft {
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

    /// Keeps `original` under another name and puts the draft in its place.
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

impl Drop for Draft {
    fn drop(&mut self) {
        // After the rename there is nothing of that name.
        let _ = fs::remove_file(&self.path);
    }
}

/// Gives the log a second name, the first of `.orig`, `.orig-2`, ... that is free.
fn keep_original(log: &Path) -> io::Result<PathBuf> {
    let mut n = 1;
    loop {
        let name = if n == 1 { ".orig".into() } else { format!(".orig-{n}") };
        let kept = with_suffix(log, &name);
        match fs::hard_link(log, &kept) {
            Ok(()) => return Ok(kept),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => n += 1,
            // Some file systems have no second names: copy instead.
            Err(_) => {
                let mut copy = OpenOptions::new().write(true).create_new(true).open(&kept)?;
                io::copy(&mut File::open(log)?, &mut copy)?;
                sync_file(&copy)?;
                return Ok(kept);
            }
        }
    }
}
