//! What a log is written to: a file, or a pipe that can't be taken back.

use std::{
    fmt,
    fs::{self, File},
    io::{self, Write},
    os::unix::fs::{FileExt as _, MetadataExt as _},
    path::Path,
};

use super::sync::sync_file;

/// The few things that [`super::LogWriter`] does to a file. Tests put faults in between.
pub trait Medium: fmt::Debug {
    /// Writes at the end, once: may take fewer bytes than offered.
    ///
    /// # Errors
    /// As the system says.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Brings everything written to the disk.
    ///
    /// # Errors
    /// As the system says; what was written before may then be lost.
    fn sync(&mut self) -> io::Result<()>;

    /// Takes back the last `bytes` bytes, written just before.
    ///
    /// # Errors
    /// When that can't be done; the end of the log is then torn.
    fn take_back(&mut self, bytes: u64) -> io::Result<()>;

    /// Length by what was written, bytes; 0 where there is no length.
    fn length(&self) -> u64 {
        0
    }

    /// Deviation from the file that `path` names; `None` if there is none, or nothing to compare.
    ///
    /// # Errors
    /// When file or path can't be examined.
    fn displacement(&self, path: &Path) -> io::Result<Option<Displacement>> {
        let _ = path;
        Ok(None)
    }

    /// Everything written from a byte on.
    ///
    /// # Errors
    /// When it can't be read back.
    fn read_from(&self, offset: u64) -> io::Result<Vec<u8>> {
        let _ = offset;
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Puts what was written in its place, after the last sync; most are there all along.
    ///
    /// # Errors
    /// As the system says.
    fn finish(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<M: Medium + ?Sized> Medium for Box<M> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        (**self).write(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        (**self).sync()
    }

    fn take_back(&mut self, bytes: u64) -> io::Result<()> {
        (**self).take_back(bytes)
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

/// Deviation of an open log from the file that its path names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Displacement {
    /// The file has no name any more; its content is gone once it is closed.
    Removed,
    /// The path names no file or another one: the file, or a folder above it, was moved, replaced or covered.
    Moved,
    /// Another program changed the file's length.
    Resized {
        /// Length by what was written, bytes.
        expected: u64,
        /// Length found, bytes.
        found: u64,
    },
}

impl fmt::Display for Displacement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Removed => f.write_str("was removed"),
            Self::Moved => f.write_str("is no longer in its place: it was moved or replaced"),
            Self::Resized { expected, found } => {
                write!(f, "was changed by another program: {found} bytes instead of {expected}")
            }
        }
    }
}

/// A regular file, opened for appending and locked.
#[derive(Debug)]
pub struct FileMedium {
    file: File,
    /// Length by what was written, bytes.
    length: u64,
}

impl FileMedium {
    /// Appends to an open file.
    ///
    /// # Errors
    /// When its length can't be read.
    pub(super) fn new(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self { file, length })
    }
}

impl Medium for FileMedium {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.length += written as u64;
        Ok(written)
    }

    fn sync(&mut self) -> io::Result<()> {
        sync_file(&self.file)
    }

    fn take_back(&mut self, bytes: u64) -> io::Result<()> {
        // The length now, not one remembered: should somebody have cut the file short meanwhile,
        // setting a remembered length would fill the difference with NUL bytes.
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

/// Standard output or any other writer: flushed, never synced.
#[derive(Debug)]
pub struct Pipe<W>(pub W);

impl<W: Write + fmt::Debug> Medium for Pipe<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.flush()
    }

    fn take_back(&mut self, bytes: u64) -> io::Result<()> {
        if bytes == 0 { Ok(()) } else { Err(io::ErrorKind::Unsupported.into()) }
    }
}
