//! Serial lines: finding, opening and locking them, with errors that tell causes apart.

mod pty;

use std::{
    fs, io,
    os::unix::fs::{FileTypeExt as _, MetadataExt as _},
    path::{Path, PathBuf},
};

use rustix::fs::{Mode, OFlags};
use serialport::{ClearBuffer, ErrorKind, SerialPort as _, SerialPortType};
use thiserror::Error;
use tokio_serial::{SerialPortBuilderExt as _, SerialStream};

pub use pty::Pty;

/// Line rate of the firmware, bits a second (8N1).
pub const BAUD: u32 = 115_200;

const BY_ID: &str = "/dev/serial/by-id";

/// A serial line that can't be used.
#[derive(Debug, Error)]
pub enum LinkError {
    /// No path and no stable id of that name.
    #[error("there is no serial port {port:?}")]
    NotFound {
        /// What was asked for.
        port: String,
        /// What there is.
        present: Vec<String>,
    },
    /// It exists, but this user may not open it.
    #[error("no permission to open {0}")]
    Permission(PathBuf),
    /// Another program has it open.
    #[error("{0} is in use by another program")]
    Busy(PathBuf),
    /// A file or a folder, or something else that is no serial line.
    #[error("{0} is not a serial port")]
    NotSerial(PathBuf),
    /// Anything else the system said.
    #[error("cannot open {port}: {source}")]
    Io {
        /// The port's path.
        port: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

impl LinkError {
    /// What a person can do about it.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::NotFound { present, .. } if present.is_empty() => {
                "no serial port is present: plug the board in, or use --mock to try without one"
                    .into()
            }
            Self::NotFound { present, .. } => format!(
                "present are {}; give one of them, or use --mock to try without a board",
                present.join(", ")
            ),
            Self::Permission(port) => format!(
                "add yourself to the group that owns it (`ls -l {}`; usually `sudo usermod -aG \
                 dialout $USER`), then log in again",
                port.display()
            ),
            Self::Busy(port) => format!(
                "find the program with `fuser -v {}` and stop it; a running daemon owns its port",
                port.display()
            ),
            Self::NotSerial(_) => {
                "give a character device such as /dev/ttyACM0, or the link a mock made".into()
            }
            Self::Io { .. } => "unplug the board, plug it in again, and look at `dmesg`".into(),
        }
    }
}

/// Opens a line for the ranger's protocol, locked against other programs and emptied of what
/// was received before.
///
/// `port` is a path, the name of an entry of `/dev/serial/by-id` (or a part of one that fits no
/// other), or a USB serial number. Must be called within a tokio runtime.
///
/// # Errors
/// [`LinkError`] tells a missing, busy, forbidden and wrong port apart.
pub fn open(port: &str) -> Result<SerialStream, LinkError> {
    let path = resolve(port)?;
    let stream = tokio_serial::new(path.to_string_lossy(), BAUD)
        .open_native_async()
        .map_err(|error| classify(&path, error))?;
    // What a device said to an earlier program is not an answer to this one.
    stream.clear(ClearBuffer::Input).map_err(|error| classify(&path, error))?;
    Ok(stream)
}

/// A serial port of this machine, as far as can be told without opening it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Candidate {
    /// Its path.
    pub port: String,
    /// Its stable name under `/dev/serial/by-id`, which survives replugging.
    pub id: Option<String>,
    /// What its USB descriptor says: manufacturer, product, serial number.
    pub usb: Option<String>,
}

/// The serial ports of this machine, those with a stable name first. None is opened.
#[must_use]
pub fn candidates() -> Vec<Candidate> {
    let ids: Vec<PathBuf> = fs::read_dir(BY_ID)
        .map(|entries| entries.flatten().map(|entry| entry.path()).collect())
        .unwrap_or_default();
    let id_of = |port: &str| {
        let target = fs::canonicalize(port).ok()?;
        let id = ids.iter().find(|id| fs::canonicalize(id).is_ok_and(|path| path == target))?;
        Some(id.file_name()?.to_string_lossy().into_owned())
    };
    let mut candidates: Vec<Candidate> = serialport::available_ports()
        .unwrap_or_default()
        .into_iter()
        .map(|port| Candidate {
            id: id_of(&port.port_name),
            usb: match port.port_type {
                SerialPortType::UsbPort(usb) => Some(
                    [usb.manufacturer, usb.product, usb.serial_number]
                        .into_iter()
                        .flatten()
                        .collect::<Vec<_>>()
                        .join(" "),
                ),
                _ => None,
            },
            port: port.port_name,
        })
        .collect();
    candidates.sort_by_key(|candidate| (candidate.id.is_none(), candidate.port.clone()));
    candidates
}

/// The device path behind a path or a stable id.
fn resolve(port: &str) -> Result<PathBuf, LinkError> {
    let path = PathBuf::from(port);
    match fs::metadata(&path) {
        Ok(metadata) if metadata.file_type().is_char_device() && !is_console(&metadata) => {
            return Ok(path);
        }
        Ok(_) => return Err(LinkError::NotSerial(path)),
        Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {
            return Err(LinkError::Permission(path));
        }
        Err(_) => {}
    }
    by_id(port)
        .or_else(|| by_usb_serial(port))
        .ok_or_else(|| LinkError::NotFound { port: port.to_owned(), present: present() })
}

/// Whether it is a terminal of people's and no line: this process's own (`/dev/tty`), the maker of
/// new ones (`/dev/ptmx`), or a console of the screen (`/dev/tty1`). To open one would lock it.
fn is_console(metadata: &fs::Metadata) -> bool {
    let device = metadata.rdev();
    matches!((rustix::fs::major(device), rustix::fs::minor(device)), (5, 0 | 2) | (4, 0..64))
}

/// Whether it can be opened and is no terminal at all, such as `/dev/null`. Asked only of what could
/// not be opened as a line: opening resets many a board.
fn is_no_terminal(path: &Path) -> bool {
    let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    rustix::fs::open(path, flags, Mode::empty()).is_ok_and(|file| !rustix::termios::isatty(file))
}

fn by_id(id: &str) -> Option<PathBuf> {
    let entries: Vec<PathBuf> =
        fs::read_dir(BY_ID).ok()?.flatten().map(|entry| entry.path()).collect();
    let named = |wanted: &dyn Fn(&str) -> bool| {
        let mut fitting = entries
            .iter()
            .filter(|path| path.file_name().and_then(|name| name.to_str()).is_some_and(wanted));
        fitting.next().filter(|_| fitting.next().is_none()).cloned()
    };
    named(&|name| name == id).or_else(|| named(&|name| !id.is_empty() && name.contains(id)))
}

fn by_usb_serial(serial: &str) -> Option<PathBuf> {
    serialport::available_ports().ok()?.into_iter().find_map(|port| match port.port_type {
        SerialPortType::UsbPort(usb) if usb.serial_number.as_deref() == Some(serial) => {
            Some(PathBuf::from(port.port_name))
        }
        _ => None,
    })
}

/// Names of the serial ports of this machine.
fn present() -> Vec<String> {
    let ports = serialport::available_ports().unwrap_or_default();
    ports.into_iter().map(|port| port.port_name).collect()
}

fn classify(path: &Path, error: serialport::Error) -> LinkError {
    let port = path.to_path_buf();
    match error.kind {
        // serialport reports a port that is locked or opened exclusively as "no device".
        ErrorKind::NoDevice if path.exists() => LinkError::Busy(port),
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => LinkError::Permission(port),
        ErrorKind::Io(io::ErrorKind::ResourceBusy) => LinkError::Busy(port),
        ErrorKind::Io(io::ErrorKind::NotFound) => {
            LinkError::NotFound { port: port.display().to_string(), present: present() }
        }
        _ if is_no_terminal(path) => LinkError::NotSerial(port),
        _ => LinkError::Io { port, source: error.into() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_port_is_named_and_what_is_present_is_said() {
        let error = resolve("/dev/no-such-port").expect_err("it does not exist");
        assert!(error.to_string().contains("/dev/no-such-port"));
        assert!(matches!(error, LinkError::NotFound { .. }));
        assert!(error.help().contains("--mock"));
    }

    #[test]
    fn a_file_is_not_a_port() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let path = file.path().to_str().expect("plain name");
        assert!(matches!(resolve(path), Err(LinkError::NotSerial(_))));
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
