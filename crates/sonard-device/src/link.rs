//! Discovery, opening and locking of serial lines, with a distinct error for each cause.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod adapter;
mod error;
mod holders;
mod opener;
mod ports;
mod pty;

use std::{
    fs, io,
    os::{
        fd::{AsRawFd, OwnedFd},
        unix::fs::{FileTypeExt as _, MetadataExt as _},
    },
    path::{Path, PathBuf},
};

use firmware_protocol::host::HostConfig;
use rand::{RngExt as _, rand_core::UnwrapErr, rngs::SysRng};
use rustix::{
    fs::{Mode, OFlags},
    io::Errno,
};
use serialport::{ClearBuffer, ErrorKind, SerialPort as _};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio_serial::{SerialPortBuilderExt as _, SerialStream};

pub use adapter::{is_kernel_console, latency_timer_ms};
pub use error::{LinkError, PortListError};
pub use holders::{Holder, Holders, find_holders};
pub use opener::PortOpener;
use ports::{PortFolders, Resolved};
pub use ports::{SerialPortInfo, list_ports};
pub use pty::Pty;

use crate::platform::{duplicate_descriptor, is_console};

/// Byte stream to a device: a serial port or an in-memory pipe.
pub trait Line: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Line for T {}

/// Line rate of the firmware, bits per second (8N1).
pub const BAUD: u32 = 115_200;

/// Settings of the host machine on a line of [`BAUD`]: numbers from a random seed, and up to
/// `max_attempts` transmissions of a request.
#[must_use]
pub fn host_config(max_attempts: u8) -> HostConfig {
    HostConfig { max_attempts, ..HostConfig::new(BAUD, UnwrapErr(SysRng).random()) }
}

/// Opens a line for the ranger's protocol, locked against other programs and with an empty input
/// buffer.
///
/// `port` is a path, the name of an entry of `/dev/serial/by-id` (or an unambiguous part of it),
/// or a USB serial number. Must be called within a tokio runtime.
///
/// # Errors
/// [`LinkError`] distinguishes a missing, ambiguous, busy, forbidden and wrong port.
pub fn open(port: &str) -> Result<SerialStream, LinkError> {
    open_path(&resolve(port, None)?.path)
}

fn open_path(path: &Path) -> Result<SerialStream, LinkError> {
    let stream = tokio_serial::new(path.to_string_lossy(), BAUD)
        .open_native_async()
        .map_err(|error| classify(path, error))?;
    // Bytes buffered before are replies to an earlier program.
    stream.clear(ClearBuffer::Input).map_err(|error| classify(path, error))?;
    Ok(stream)
}

/// Kernel path of the device that a port name resolves to.
///
/// # Errors
/// As [`open`], except for errors of the opening itself.
pub fn device_path(port: &str) -> Result<PathBuf, LinkError> {
    Ok(holders::real_path(&resolve(port, None)?.path))
}

/// Duplicates the descriptor of an open line, which exposes it only as a number.
///
/// # Errors
/// Returns the error of the system, for example of a kernel without the call.
pub fn duplicate(line: &impl AsRawFd) -> io::Result<OwnedFd> {
    duplicate_descriptor(line.as_raw_fd())
}

/// Describes the other programs that have `port` open, with a remedy; `None` if none is visible.
///
/// A program that reads the same port consumes bytes, which looks like an unresponsive or faulty
/// board.
#[must_use]
pub fn describe_contention(port: &str) -> Option<String> {
    let path = device_path(port).ok()?;
    let holders = find_holders(&path);
    let advice = holders.remedy(&path)?;
    Some(format!(
        "{} has the port open, too, and may consume its bytes: {advice}",
        holders.describe("")
    ))
}

/// Resolves a path, a stable id or a serial number to a device. Among several matching ids,
/// `preferred` is chosen.
fn resolve(port: &str, preferred: Option<&str>) -> Result<Resolved, LinkError> {
    let path = PathBuf::from(port);
    match fs::metadata(&path) {
        Ok(metadata)
            if metadata.file_type().is_char_device() && !is_console(&path, metadata.rdev()) =>
        {
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

/// Returns `true` if a path can be opened and is not a terminal, such as `/dev/null`. Called only
/// after a failed opening as a line, because opening a port resets many boards.
///
/// # Errors
/// If the path can't be opened, with the error number that the earlier error lacks.
fn is_no_terminal(path: &Path) -> Result<bool, Errno> {
    let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let file = rustix::fs::open(path, flags, Mode::empty())?;
    Ok(!rustix::termios::isatty(file))
}

fn classify(path: &Path, error: serialport::Error) -> LinkError {
    let port = path.to_path_buf();
    match error.kind {
        // serialport reports a port that is locked or opened exclusively as "no device".
        ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::ResourceBusy) if path.exists() => {
            LinkError::Busy { holders: find_holders(path), port }
        }
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => LinkError::Permission(port),
        ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::NotFound) => LinkError::NotFound {
            port: port.display().to_string(),
            present: PortFolders::system().present(),
        },
        _ => classify_reopening(port, is_no_terminal(path), error),
    }
}

/// Classifies an error without a number by a second opening of the port.
fn classify_reopening(
    port: PathBuf,
    is_no_terminal: Result<bool, Errno>,
    error: serialport::Error,
) -> LinkError {
    match is_no_terminal {
        Ok(true) => LinkError::NotSerial(port),
        Ok(false) => LinkError::Io { port, source: error.into() },
        // File permissions deny access by EACCES.
        Err(Errno::PERM) => LinkError::DevicePolicy(port),
        Err(error) => LinkError::Io { port, source: error.into() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_port_is_named() {
        let error = resolve("/dev/no-such-port", None).expect_err("it does not exist");
        assert!(error.to_string().contains("/dev/no-such-port"));
        assert!(matches!(error, LinkError::NotFound { .. }));
        assert!(error.help().contains("--mock"));
    }

    #[test]
    fn device_policy_is_named() {
        let unknown = || serialport::Error::new(ErrorKind::Unknown, "EPERM");
        let classified = |outcome| classify_reopening("/dev/ttyACM0".into(), outcome, unknown());
        let error = classified(Err(Errno::PERM));
        assert!(matches!(error, LinkError::DevicePolicy(_)), "{error}");
        assert!(error.help().contains("DeviceAllow="), "{}", error.help());
        let error = classified(Err(Errno::NXIO));
        assert!(error.help().contains("no hardware"), "{}", error.help());
        assert!(matches!(classified(Ok(true)), LinkError::NotSerial(_)));
    }

    #[test]
    fn file_is_not_a_port() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let path = file.path().to_str().expect("plain name");
        assert!(matches!(resolve(path, None), Err(LinkError::NotSerial(_))));
    }

    #[tokio::test]
    async fn other_devices_are_rejected() {
        for path in ["/dev/null", "/dev/zero", "/dev/urandom", "/dev/tty", "/dev/ptmx", "/dev", "/"]
        {
            match open(path) {
                Err(error @ LinkError::NotSerial(_)) => assert!(error.to_string().contains(path)),
                // Missing in a container.
                Err(LinkError::NotFound { .. }) => assert!(!Path::new(path).exists(), "{path}"),
                other => panic!("{path}: {other:?}"),
            }
        }
    }
}
