//! Opening of a log for appending, with lock and repair of a torn last line.

use std::{
    ffi::OsString,
    fs::{self, File, OpenOptions, TryLockError},
    io::{self, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use jiff::Timestamp;
use sonard_records::{Event, EventKind, MAX_LINE_BYTES};

use super::{
    FileOutput, LogOutput, PipeOutput, StoreError,
    platform::{self, FileId, is_unsupported, read_exact_at},
    reader,
    sync::{sync_file, sync_folder_of},
};

/// Repair made at the end of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Recovered {
    /// Newline added after a complete last record.
    Newline,
    /// Torn last line, moved into a separate file.
    Torn {
        /// Offset at which the log was truncated, bytes.
        offset: u64,
        /// Length of the torn line, bytes.
        bytes: u64,
        /// Path of the file with the torn bytes.
        kept: PathBuf,
    },
}

impl Recovered {
    /// Event that records the loss in the log; `None` if no data was lost.
    #[must_use]
    pub fn event(&self) -> Option<Event> {
        let Self::Torn { offset, bytes, kept } = self else { return None };
        let name = kept.file_name().unwrap_or_default().to_string_lossy();
        Some(Event {
            time: Timestamp::now(),
            kind: EventKind::Gap,
            detail: format!(
                "the last record was torn at byte {offset}; its {bytes} bytes are kept in {name}"
            ),
        })
    }
}

/// Opens, locks and repairs a log for a [`super::LogWriter`].
pub(super) fn open_file(
    path: &Path,
) -> Result<(Box<dyn LogOutput + Send>, Option<Recovered>), StoreError> {
    let fail = |source| StoreError::Open { path: path.into(), source };
    let existing = fs::symlink_metadata(path);
    if existing.as_ref().is_ok_and(|meta| !meta.is_file() && !meta.is_dir() && !meta.is_symlink()) {
        // A FIFO or a device is neither locked nor repaired.
        let file = open_no_follow(OpenOptions::new().append(true), path).map_err(fail)?;
        return Ok((Box::new(PipeOutput(file)), None));
    }
    let file = open_locked(path)?;
    if existing.is_err()
        && let Err(error) = sync_folder_of(path)
    {
        // The log is still empty: a failed creation leaves no file.
        let _ = fs::remove_file(path);
        return Err(fail(error));
    }
    let recovered = repair_end(&file, path).map_err(fail)?;
    Ok((Box::new(FileOutput::new(file).map_err(fail)?), recovered))
}

/// Opens a file for modification and rejects symbolic links, whose target may not belong to this
/// program.
///
/// # Errors
/// Returns the error of the system, or an error for a symbolic link.
pub fn open_no_follow(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    let rejected = |error| match fs::symlink_metadata(path) {
        Ok(there) if there.is_symlink() => io::Error::new(
            io::ErrorKind::InvalidInput,
            "it is a symbolic link, whose target is not modified",
        ),
        _ => error,
    };
    let file = platform::reject_links(options).open(path).map_err(rejected)?;
    if file.metadata()?.is_symlink() {
        return Err(rejected(io::ErrorKind::InvalidInput.into()));
    }
    Ok(file)
}

/// Opens and locks a regular file, and reopens it if a repair replaced the file between opening and
/// locking.
fn open_locked(path: &Path) -> Result<File, StoreError> {
    let fail = |source| StoreError::Open { path: path.into(), source };
    loop {
        let file = open_no_follow(OpenOptions::new().read(true).append(true).create(true), path)
            .map_err(fail)?;
        let ours = file.metadata().map_err(fail)?;
        if !ours.is_file() {
            return Err(fail(io::Error::new(
                io::ErrorKind::InvalidInput,
                "it is not a regular file",
            )));
        }
        lock(&file, path)?;
        let id = FileId::of_file(&file).map_err(fail)?;
        if FileId::of_entry(path).is_ok_and(|named| named == id) {
            return Ok(file);
        }
    }
}

/// Acquires the advisory lock of writers and repairs.
pub(super) fn lock(file: &File, path: &Path) -> Result<(), StoreError> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(StoreError::Busy { path: path.into() }),
        Err(TryLockError::Error(error)) if is_unsupported(&error) => {
            tracing::warn!(
                "{} cannot be locked on this file system ({error}): make sure that no other program writes to it",
                path.display()
            );
            Ok(())
        }
        Err(TryLockError::Error(source)) => Err(StoreError::Open { path: path.into(), source }),
    }
}

/// Returns `true` if a process is writing or repairing the log.
#[must_use]
pub fn is_locked(file: &File) -> bool {
    let locked = file.try_lock_shared();
    if locked.is_ok() {
        // Released immediately: the lock was only a test.
        let _ = file.unlock();
    }
    matches!(locked, Err(TryLockError::WouldBlock))
}

/// Repairs the end of a log, so that it ends with a newline. Torn bytes move to a separate file.
fn repair_end(file: &File, path: &Path) -> io::Result<Option<Recovered>> {
    let length = file.metadata()?.len();
    let offset = last_line_offset(file, length)?;
    let bytes = length - offset;
    if bytes == 0 {
        return Ok(None);
    }
    if bytes <= MAX_LINE_BYTES as u64 {
        let mut last = vec![0; bytes as usize];
        read_exact_at(file, &mut last, offset)?;
        if reader::decode(&last, if offset == 0 { 1 } else { 2 }, false).is_ok() {
            io::Write::write_all(&mut &*file, b"\n")?;
            sync_file(file)?;
            return Ok(Some(Recovered::Newline));
        }
    }
    let kept = keep_torn(file, offset, path)?;
    file.set_len(offset)?;
    sync_file(file)?;
    Ok(Some(Recovered::Torn { offset, bytes, kept }))
}

/// Offset of the first byte after the last newline.
#[expect(clippy::indexing_slicing, reason = "a part is never longer than the chunk")]
fn last_line_offset(file: &File, length: u64) -> io::Result<u64> {
    let mut chunk = vec![0; 1 << 16];
    let mut end = length;
    while end > 0 {
        let start = end.saturating_sub(chunk.len() as u64);
        let part = &mut chunk[..(end - start) as usize];
        read_exact_at(file, part, start)?;
        if let Some(at) = part.iter().rposition(|&byte| byte == b'\n') {
            return Ok(start + at as u64 + 1);
        }
        end = start;
    }
    Ok(0)
}

/// Copies the bytes from `offset` to `<log>.torn-<n>` and syncs the copy.
fn keep_torn(mut file: &File, offset: u64, path: &Path) -> io::Result<PathBuf> {
    let (mut kept, name) = create_next(|n| with_suffix(path, &format!(".torn-{n}")))?;
    file.seek(SeekFrom::Start(offset))?;
    let copied = io::copy(&mut file, &mut kept).and_then(|_| sync_file(&kept));
    if let Err(error) = copied {
        // The log still has the bytes, so a partial copy is removed.
        let _ = fs::remove_file(&name);
        return Err(error);
    }
    sync_folder_of(path)?;
    Ok(name)
}

/// Creates the first non-existing file of a series numbered from 1.
fn create_next(name: impl Fn(u32) -> PathBuf) -> io::Result<(File, PathBuf)> {
    let mut n = 1;
    loop {
        let path = name(n);
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => return Ok((file, path)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => n += 1,
            Err(error) => return Err(error),
        }
    }
}

/// Appends a suffix to the file name of `path`.
pub(super) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(suffix);
    name.into()
}
