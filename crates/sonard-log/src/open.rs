//! Opens a log for appending: lock, and a torn last line set right.

use std::{
    ffi::OsString,
    fs::{self, File, OpenOptions},
    io::{self, Seek, SeekFrom},
    os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt},
    path::{Path, PathBuf},
};

use jiff::Timestamp;
use rustix::{
    fs::{FlockOperation, OFlags, flock},
    io::Errno,
};
use sonard_records::{Event, EventKind, MAX_LINE_BYTES};

use super::{
    FileMedium, Medium, Pipe, StoreError, reader,
    sync::{is_unsupported, sync_file, sync_folder_of},
};

/// The damage at the end of a log and its repair.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Recovered {
    /// The last record was whole and only its newline was missing.
    Newline,
    /// The last line was torn; its bytes were moved to a file of their own.
    Torn {
        /// Where the log was cut, bytes.
        offset: u64,
        /// Length of the torn line, bytes.
        bytes: u64,
        /// Where the torn bytes are kept.
        kept: PathBuf,
    },
}

impl Recovered {
    /// The event that tells readers of the data, if data was lost.
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

/// Opens `path` for a [`super::LogWriter`].
pub(super) fn open_file(
    path: &Path,
) -> Result<(Box<dyn Medium + Send>, Option<Recovered>), StoreError> {
    let fail = |source| StoreError::Open { path: path.into(), source };
    let existing = fs::symlink_metadata(path);
    if existing.as_ref().is_ok_and(|meta| !meta.is_file() && !meta.is_dir() && !meta.is_symlink()) {
        // A FIFO or a device: nothing to lock, nothing to mend.
        let file = open_own(OpenOptions::new().append(true), path).map_err(fail)?;
        return Ok((Box::new(Pipe(file)), None));
    }
    let file = open_locked(path)?;
    if existing.is_err()
        && let Err(error) = sync_folder_of(path)
    {
        // Nothing is written to it yet, and nothing is to be left of a log that could not be made.
        let _ = fs::remove_file(path);
        return Err(fail(error));
    }
    let recovered = mend_end(&file, path).map_err(fail)?;
    Ok((Box::new(FileMedium::new(file).map_err(fail)?), recovered))
}

/// Opens a file that is to be changed, where it is: a symbolic link in its place is refused, since
/// what it leads to is not this program's to mend.
///
/// # Errors
/// As the system says, or that it is a link.
pub fn open_own(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    let opened = options.custom_flags(OFlags::NOFOLLOW.bits().cast_signed()).open(path);
    opened.map_err(|error| match fs::symlink_metadata(path) {
        Ok(there) if there.is_symlink() => io::Error::new(
            io::ErrorKind::InvalidInput,
            "it is a symbolic link, and what it leads to is not written to",
        ),
        _ => error,
    })
}

/// Opens and locks a regular file, and makes sure that the path still means it: a repair may
/// have put another file in its place between the two.
fn open_locked(path: &Path) -> Result<File, StoreError> {
    let fail = |source| StoreError::Open { path: path.into(), source };
    loop {
        let file = open_own(OpenOptions::new().read(true).append(true).create(true), path)
            .map_err(fail)?;
        let ours = file.metadata().map_err(fail)?;
        if !ours.is_file() {
            return Err(fail(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file")));
        }
        lock(&file, path)?;
        let named = fs::symlink_metadata(path);
        if named.is_ok_and(|named| (named.dev(), named.ino()) == (ours.dev(), ours.ino())) {
            return Ok(file);
        }
    }
}

/// Takes the advisory lock that every writer and every repair of a log holds.
pub(super) fn lock(file: &File, path: &Path) -> Result<(), StoreError> {
    match flock(file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(()),
        Err(rustix::io::Errno::WOULDBLOCK) => Err(StoreError::Busy { path: path.into() }),
        Err(error) if is_unsupported(error.raw_os_error()) || error == Errno::NOLCK => {
            tracing::warn!(
                "{} can't be locked on this file system ({error}): make sure that no other program writes to it",
                path.display()
            );
            Ok(())
        }
        Err(error) => Err(StoreError::Open { path: path.into(), source: error.into() }),
    }
}

/// Whether some process is writing (or repairing) the log now.
#[must_use]
pub fn is_being_written(file: &File) -> bool {
    let busy = flock(file, FlockOperation::NonBlockingLockShared);
    if busy.is_ok() {
        // Held for no longer than this look takes.
        let _ = flock(file, FlockOperation::Unlock);
    }
    busy == Err(rustix::io::Errno::WOULDBLOCK)
}

/// Makes the log end with a newline, and loses nothing by it.
fn mend_end(file: &File, path: &Path) -> io::Result<Option<Recovered>> {
    let length = file.metadata()?.len();
    let offset = last_line_offset(file, length)?;
    let bytes = length - offset;
    if bytes == 0 {
        return Ok(None);
    }
    if bytes <= MAX_LINE_BYTES as u64 {
        let mut last = vec![0; bytes as usize];
        file.read_exact_at(&mut last, offset)?;
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

/// Where the bytes after the last newline begin.
#[expect(clippy::indexing_slicing, reason = "a part is never longer than the chunk")]
fn last_line_offset(file: &File, length: u64) -> io::Result<u64> {
    let mut chunk = vec![0; 1 << 16];
    let mut end = length;
    while end > 0 {
        let start = end.saturating_sub(chunk.len() as u64);
        let part = &mut chunk[..(end - start) as usize];
        file.read_exact_at(part, start)?;
        if let Some(at) = part.iter().rposition(|&byte| byte == b'\n') {
            return Ok(start + at as u64 + 1);
        }
        end = start;
    }
    Ok(0)
}

/// Copies everything from `offset` on to `<log>.torn-<n>` and brings it to the disk.
fn keep_torn(mut file: &File, offset: u64, path: &Path) -> io::Result<PathBuf> {
    let (mut kept, name) = create_next(|n| with_suffix(path, &format!(".torn-{n}")))?;
    file.seek(SeekFrom::Start(offset))?;
    let copied = io::copy(&mut file, &mut kept).and_then(|_| sync_file(&kept));
    if let Err(error) = copied {
        // The log still has the bytes; half a copy would only confuse.
        let _ = fs::remove_file(&name);
        return Err(error);
    }
    sync_folder_of(path)?;
    Ok(name)
}

/// Creates the first file of a numbered series, from 1, that does not exist yet.
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

/// `path` with something after its name.
pub(super) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(suffix);
    name.into()
}
