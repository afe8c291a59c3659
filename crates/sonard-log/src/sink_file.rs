//! Outputs of the log writer: a regular file, or a pipe without truncation.

use std::{
    collections::HashSet,
    fmt,
    fs::{self, File},
    io::{self, Seek as _, SeekFrom, Write},
    path::Path,
};

use super::{
    platform::{FileId, is_removed_when_closed, link_count, read_exact_at},
    sync::{sync_file, sync_folder_of},
};

/// Maximum length of a file's end that is searched for lines, bytes.
const MAX_SEARCHED_BYTES: u64 = 64 << 20;

/// File operations of [`super::LogWriter`]. Tests implement them with faults.
pub trait LogOutput: fmt::Debug {
    /// Appends bytes with one write and returns the number written, which may be smaller.
    ///
    /// # Errors
    /// Returns the error of the system.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Syncs all written bytes.
    ///
    /// # Errors
    /// Returns the error of the system; unsynced bytes may then be lost.
    fn sync(&mut self) -> io::Result<()>;

    /// Removes the last `bytes` bytes, which were just written.
    ///
    /// # Errors
    /// Returns an error if truncation fails; the log then ends in a torn line.
    fn remove_last(&mut self, bytes: u64) -> io::Result<()>;

    /// Compares the open file with the file at `path`; `None` if they agree or cannot be compared.
    ///
    /// # Errors
    /// Returns an error if file or path cannot be examined.
    fn displacement(&self, path: &Path) -> io::Result<Option<Displacement>> {
        let _ = path;
        Ok(None)
    }

    /// Removes complete lines that occur in `lines` from the end, and returns the new length,
    /// bytes.
    ///
    /// # Errors
    /// Returns an error if the output cannot be truncated.
    fn withdraw(&mut self, lines: &[u8]) -> io::Result<u64> {
        let _ = lines;
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Returns those of the given lines that the output does not contain, with the newlines.
    ///
    /// # Errors
    /// Returns an error if the output is not readable.
    fn missing(&self, lines: &[u8]) -> io::Result<Vec<u8>> {
        let _ = lines;
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Writes the whole content to a new file at `path`.
    ///
    /// # Errors
    /// Returns an error if the output is not readable, or the file exists or cannot be written.
    fn restore(&mut self, path: &Path) -> io::Result<()> {
        let _ = path;
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Moves the output to its final path after the last sync, where an output has one.
    ///
    /// # Errors
    /// Returns the error of the system.
    fn finish(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<M: LogOutput + ?Sized> LogOutput for Box<M> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        (**self).write(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        (**self).sync()
    }

    fn remove_last(&mut self, bytes: u64) -> io::Result<()> {
        (**self).remove_last(bytes)
    }

    fn displacement(&self, path: &Path) -> io::Result<Option<Displacement>> {
        (**self).displacement(path)
    }

    fn withdraw(&mut self, lines: &[u8]) -> io::Result<u64> {
        (**self).withdraw(lines)
    }

    fn missing(&self, lines: &[u8]) -> io::Result<Vec<u8>> {
        (**self).missing(lines)
    }

    fn restore(&mut self, path: &Path) -> io::Result<()> {
        (**self).restore(path)
    }

    fn finish(&mut self) -> io::Result<()> {
        (**self).finish()
    }
}

/// Difference between an open log and the file at its path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Displacement {
    /// Deleted file; the content is lost once the log is closed.
    Removed,
    /// Missing or different file at the path: the log or a parent folder was moved, replaced or
    /// hidden by a mount.
    Moved,
    /// Length changed by another program.
    Resized {
        /// Length from the written bytes.
        expected: u64,
        /// Length of the file, bytes.
        found: u64,
    },
}

impl Displacement {
    /// Returns `true` if records are no longer reachable by any path, or not from the next close
    /// on.
    #[must_use]
    pub const fn loses_records(self) -> bool {
        match self {
            Self::Removed => true,
            Self::Moved => false,
            Self::Resized { expected, found } => found < expected,
        }
    }
}

impl fmt::Display for Displacement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Removed => f.write_str("was removed"),
            Self::Moved => f.write_str("was moved or replaced"),
            Self::Resized { expected, found } => {
                write!(f, "was changed by another program: {found} bytes instead of {expected}")
            }
        }
    }
}

/// Regular file, opened for appending and locked.
#[derive(Debug)]
pub struct FileOutput {
    file: File,
    /// Length from the written bytes.
    length: u64,
}

impl FileOutput {
    /// Wraps an open file.
    ///
    /// # Errors
    /// Returns an error if the length cannot be read.
    pub(super) fn new(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self { file, length })
    }
}

impl LogOutput for FileOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.length += written as u64;
        Ok(written)
    }

    fn sync(&mut self) -> io::Result<()> {
        sync_file(&self.file)
    }

    fn remove_last(&mut self, bytes: u64) -> io::Result<()> {
        // Uses the current length: if another program truncated the file, a stored length would
        // extend the file with NUL bytes.
        let length = self.file.metadata()?.len();
        self.file.set_len(length.saturating_sub(bytes))?;
        self.length = self.length.saturating_sub(bytes);
        Ok(())
    }

    fn displacement(&self, path: &Path) -> io::Result<Option<Displacement>> {
        use io::ErrorKind as Kind;
        let open = FileId::of_file(&self.file)?;
        let is_in_place = match FileId::of_entry(path) {
            Ok(named) => named == open,
            Err(error) => match error.kind() {
                Kind::NotFound | Kind::NotADirectory | Kind::PermissionDenied => false,
                _ => return Err(error),
            },
        };
        let expected = self.length;
        let found = self.file.metadata()?.len();
        Ok(match (is_in_place, link_count(&self.file)?, found) {
            (true, _, found) => {
                (found != expected).then_some(Displacement::Resized { expected, found })
            }
            (false, 0, _) => Some(Displacement::Removed),
            (false, ..) if is_removed_when_closed(&self.file) => Some(Displacement::Removed),
            (false, ..) => Some(Displacement::Moved),
        })
    }

    fn withdraw(&mut self, lines: &[u8]) -> io::Result<u64> {
        let written_again: HashSet<&[u8]> = lines.split_inclusive(|&byte| byte == b'\n').collect();
        let length = self.file.metadata()?.len();
        let mut end = vec![0; lines.len().min(usize::try_from(length).unwrap_or(usize::MAX))];
        let end_at = length - end.len() as u64;
        read_exact_at(&self.file, &mut end, end_at)?;
        let found = end.split_inclusive(|&byte| byte == b'\n').rev();
        let repeated = found.take_while(|line| written_again.contains(line));
        let length = length - repeated.map(|line| line.len() as u64).sum::<u64>();
        self.file.set_len(length)?;
        self.length = length;
        sync_file(&self.file)?;
        Ok(length)
    }

    fn missing(&self, lines: &[u8]) -> io::Result<Vec<u8>> {
        let from = self.length.saturating_sub(lines.len() as u64);
        let length = self.file.metadata()?.len().saturating_sub(from);
        if length > MAX_SEARCHED_BYTES {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        let mut end = vec![0; usize::try_from(length).unwrap_or(0)];
        read_exact_at(&self.file, &mut end, from)?;
        let found: HashSet<&[u8]> = end.split_inclusive(|&byte| byte == b'\n').collect();
        let lines = lines.split_inclusive(|&byte| byte == b'\n');
        Ok(lines.filter(|line| !found.contains(line)).collect::<Vec<_>>().concat())
    }

    fn restore(&mut self, path: &Path) -> io::Result<()> {
        let mut copy = File::create_new(path)?;
        self.file.seek(SeekFrom::Start(0))?;
        let copied = io::copy(&mut self.file, &mut copy).and_then(|_| sync_file(&copy));
        if let Err(error) = copied.and_then(|()| sync_folder_of(path)) {
            let _ = fs::remove_file(path);
            return Err(error);
        }
        Ok(())
    }
}

/// Standard output or another writer, which is flushed but not synced.
#[derive(Debug)]
pub struct PipeOutput<W>(pub W);

impl<W: Write + fmt::Debug> LogOutput for PipeOutput<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.flush()
    }

    fn remove_last(&mut self, bytes: u64) -> io::Result<()> {
        if bytes == 0 { Ok(()) } else { Err(io::ErrorKind::Unsupported.into()) }
    }
}
