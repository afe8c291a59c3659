//! Outputs of the log writer: a regular file, or a pipe without truncation.

use std::{
    fmt,
    fs::{self, File},
    io::{self, Write},
    os::unix::fs::{FileExt as _, MetadataExt as _},
    path::Path,
};

use super::sync::sync_file;

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

    /// Expected length from the written bytes; 0 for outputs without a length.
    fn length(&self) -> u64 {
        0
    }

    /// Compares the open file with the file at `path`; `None` if they agree or cannot be compared.
    ///
    /// # Errors
    /// Returns an error if file or path cannot be examined.
    fn displacement(&self, path: &Path) -> io::Result<Option<Displacement>> {
        let _ = path;
        Ok(None)
    }

    /// Reads back all bytes from an offset.
    ///
    /// # Errors
    /// Returns an error if the output is not readable.
    fn read_from(&self, offset: u64) -> io::Result<Vec<u8>> {
        let _ = offset;
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

    fn length(&self) -> u64 {
        (**self).length()
    }

    fn displacement(&self, path: &Path) -> io::Result<Option<Displacement>> {
        (**self).displacement(path)
    }

    fn read_from(&self, offset: u64) -> io::Result<Vec<u8>> {
        (**self).read_from(offset)
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

    fn length(&self) -> u64 {
        self.length
    }

    fn displacement(&self, path: &Path) -> io::Result<Option<Displacement>> {
        use io::ErrorKind as Kind;
        let open = self.file.metadata()?;
        let is_in_place = match fs::symlink_metadata(path) {
            Ok(named) => (named.dev(), named.ino()) == (open.dev(), open.ino()),
            Err(error) => match error.kind() {
                Kind::NotFound | Kind::NotADirectory | Kind::PermissionDenied => false,
                _ => return Err(error),
            },
        };
        let expected = self.length;
        Ok(match (is_in_place, open.nlink(), open.len()) {
            (true, _, found) => {
                (found != expected).then_some(Displacement::Resized { expected, found })
            }
            (false, 0, _) => Some(Displacement::Removed),
            (false, ..) => Some(Displacement::Moved),
        })
    }

    fn read_from(&self, offset: u64) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; usize::try_from(self.length.saturating_sub(offset)).unwrap_or(0)];
        self.file.read_exact_at(&mut bytes, offset)?;
        Ok(bytes)
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
