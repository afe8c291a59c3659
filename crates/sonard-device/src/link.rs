//! Serial lines: finding, opening and locking them, with errors that tell causes apart.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod adapter;
mod error;
mod holders;
mod opener;
mod ports;
mod pty;

use std::{
    fs, io,
    os::unix::fs::{FileTypeExt as _, MetadataExt as _},
    path::{Path, PathBuf},
};

use rustix::{
    fs::{Access, Mode, OFlags},
    io::Errno,
};
use serialport::{ClearBuffer, ErrorKind, SerialPort as _};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio_serial::{SerialPortBuilderExt as _, SerialStream};

pub use adapter::{is_kernel_console, latency_timer_ms};
pub use error::{LinkError, PortListError};
pub use holders::{Holder, Holders, find_holders};
pub use opener::PortOpener;
pub use ports::{Candidate, candidates};
use ports::{PortFolders, Resolved};
pub use pty::Pty;

/// Byte stream to a device: a serial port, or a pipe in memory.
pub trait Line: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Line for T {}

/// Line rate of the firmware, bits per second (8N1).
pub const BAUD: u32 = 115_200;

/// Opens a line for the ranger's protocol, locked against other programs and emptied of what
/// was received before.
///
/// `port` is a path, the name of an entry of `/dev/serial/by-id` (or a part of one that fits no
/// other), or a USB serial number. Must be called within a tokio runtime.
///
/// # Errors
/// [`LinkError`] tells a missing, ambiguous, busy, forbidden and wrong port apart.
pub fn open(port: &str) -> Result<SerialStream, LinkError> {
    open_path(&resolve(port, None)?.path)
}

fn open_path(path: &Path) -> Result<SerialStream, LinkError> {
    let stream = tokio_serial::new(path.to_string_lossy(), BAUD)
        .open_native_async()
        .map_err(|error| classify(path, error))?;
    // What a device said to an earlier program is not an answer to this one.
    stream.clear(ClearBuffer::Input).map_err(|error| classify(path, error))?;
    Ok(stream)
}

/// Path of the device that a port's name stands for, as the kernel names it.
///
/// # Errors
/// As [`open`], apart from what only opening reveals.
pub fn device_path(port: &str) -> Result<PathBuf, LinkError> {
    Ok(holders::real_path(&resolve(port, None)?.path))
}

/// The programs that have `port` open besides this one, with a remedy; `None` if none is visible.
///
/// A program that reads the same port takes bytes away, which looks like a silent or faulty board.
#[must_use]
pub fn describe_contention(port: &str) -> Option<String> {
    let path = device_path(port).ok()?;
    let holders = find_holders(&path);
    let advice = holders.advice(&path)?;
    Some(format!(
        "{} has the port open, too, and may take its bytes: {advice}",
        holders.describe("")
    ))
}

/// The device behind a path, a stable id or a serial number. Of several ids that match, `preferred`
/// is taken.
fn resolve(port: &str, preferred: Option<&str>) -> Result<Resolved, LinkError> {
    let path = PathBuf::from(port);
    match fs::metadata(&path) {
        Ok(metadata) if metadata.file_type().is_char_device() && !is_console(&metadata) => {
            return Ok(Resolved { path, matched_id: None });
        }
        Ok(_) => return Err(LinkError::NotSerial(path)),
        Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {
            return Err(LinkError::Permission(path));
        }
        Err(_) => {}
    }
    PortFolders::system().find(port, preferred)
}

/// Whether it is a terminal of people's and no line: this process's own (`/dev/tty`), the maker of
/// new ones (`/dev/ptmx`), or a console of the screen (`/dev/tty1`). To open one would lock it.
fn is_console(metadata: &fs::Metadata) -> bool {
    let device = metadata.rdev();
    matches!((rustix::fs::major(device), rustix::fs::minor(device)), (5, 0 | 2) | (4, 0..64))
}

/// `true` if a path can be opened and is no terminal at all, such as `/dev/null`. Tried only if it could
/// not be opened as a line, because opening resets many a board.
///
/// # Errors
/// If it can't be opened either, with the number that the other error has lost.
fn is_no_terminal(path: &Path) -> Result<bool, Errno> {
    let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let file = rustix::fs::open(path, flags, Mode::empty())?;
    Ok(!rustix::termios::isatty(file))
}

/// `true` if the kernel denies access by another rule than the file's permissions: those give EACCES,
/// a cgroup's device policy EPERM.
fn is_denied_by_policy(path: &Path) -> bool {
    rustix::fs::access(path, Access::READ_OK | Access::WRITE_OK) == Err(Errno::PERM)
}

fn classify(path: &Path, error: serialport::Error) -> LinkError {
    let port = path.to_path_buf();
    match error.kind {
        // serialport reports a port that is locked or opened exclusively as "no device".
        ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::ResourceBusy) if path.exists() => {
            LinkError::Busy { holders: find_holders(path), port }
        }
        ErrorKind::Io(io::ErrorKind::PermissionDenied) if is_denied_by_policy(path) => {
            LinkError::DevicePolicy(port)
        }
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => LinkError::Permission(port),
        ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::NotFound) => LinkError::NotFound {
            port: port.display().to_string(),
            present: PortFolders::system().present(),
        },
        _ => match is_no_terminal(path) {
            Ok(true) => LinkError::NotSerial(port),
            Ok(false) => LinkError::Io { port, source: error.into() },
            Err(error) => LinkError::Io { port, source: error.into() },
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_port_is_named_and_what_is_present_is_said() {
        let error = resolve("/dev/no-such-port", None).expect_err("it does not exist");
        assert!(error.to_string().contains("/dev/no-such-port"));
        assert!(matches!(error, LinkError::NotFound { .. }));
        assert!(error.help().contains("--mock"));
    }

    #[test]
    fn a_file_is_not_a_port() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let path = file.path().to_str().expect("plain name");
        assert!(matches!(resolve(path, None), Err(LinkError::NotSerial(_))));
    }

    #[tokio::test]
    async fn devices_that_are_no_line_are_refused_by_name() {
        for path in ["/dev/null", "/dev/zero", "/dev/urandom", "/dev/tty", "/dev/ptmx", "/dev", "/"]
        {
            match open(path) {
                Err(error @ LinkError::NotSerial(_)) => assert!(error.to_string().contains(path)),
                // What a container lacks.
                Err(LinkError::NotFound { .. }) => assert!(!Path::new(path).exists(), "{path}"),
                other => panic!("{path}: {other:?}"),
            }
        }
    }
}
