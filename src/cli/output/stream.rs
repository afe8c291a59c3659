//! Destination of a verb's output.

use std::{
    fs::File,
    io::{self, BufWriter, Stdout, Write},
    mem,
};

use crate::store::{AtomicFile, LogOutput};

/// Destination of a verb's output.
#[derive(Debug)]
pub(in crate::cli) enum Stream {
    Standard(BufWriter<Stdout>),
    File(BufWriter<AtomicFile>),
    Device(File),
    /// No further output is possible.
    Finished,
}

impl Stream {
    pub(in crate::cli) fn standard() -> Self {
        Self::Standard(BufWriter::new(io::stdout()))
    }

    /// Completes the output; a file is renamed to its destination.
    pub(in crate::cli) fn finish(&mut self) -> io::Result<()> {
        self.flush()?;
        match mem::replace(self, Self::Finished) {
            Self::File(file) => file.into_inner().map_err(io::IntoInnerError::into_error)?.commit(),
            Self::Standard(_) | Self::Device(_) | Self::Finished => Ok(()),
        }
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Standard(out) => out.write(bytes),
            Self::File(out) => out.write(bytes),
            Self::Device(out) => out.write(bytes),
            Self::Finished => Err(io::ErrorKind::BrokenPipe.into()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Standard(out) => out.flush(),
            Self::File(out) => out.flush(),
            Self::Device(out) => out.flush(),
            Self::Finished => Ok(()),
        }
    }
}

impl LogOutput for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Write::write(self, bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.flush()
    }

    fn remove_last(&mut self, bytes: u64) -> io::Result<()> {
        if bytes == 0 { Ok(()) } else { Err(io::ErrorKind::Unsupported.into()) }
    }

    fn finish(&mut self) -> io::Result<()> {
        Self::finish(self)
    }
}
