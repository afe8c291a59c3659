//! What a log is written to: a file, or a pipe that can't be taken back.

use std::{
    fmt,
    fs::File,
    io::{self, Write},
};

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

    fn finish(&mut self) -> io::Result<()> {
        (**self).finish()
    }
}

/// A regular file, opened for appending and locked.
#[derive(Debug)]
pub struct FileMedium(pub(super) File);

impl Medium for FileMedium {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.sync_data()
    }

    fn take_back(&mut self, bytes: u64) -> io::Result<()> {
        // The length now, not one remembered: should somebody have cut the file short meanwhile,
        // setting a remembered length would fill the difference with NUL bytes.
        let length = self.0.metadata()?.len();
        self.0.set_len(length.saturating_sub(bytes))
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
