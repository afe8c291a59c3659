//! Causes of a serial line that cannot be used, each with a remedy.

use std::{
    io,
    path::{Path, PathBuf},
};

use rustix::io::Errno;
use thiserror::Error;

use super::Holders;

/// Failure to open a serial line.
#[derive(Debug, Error)]
pub enum LinkError {
    /// No path, stable id or USB serial number of that name.
    #[error("there is no serial port {port:?}")]
    NotFound {
        /// Port name as requested.
        port: String,
        /// Serial ports of this computer, or the error of listing them.
        present: Result<Vec<String>, PortListError>,
    },
    /// The name matches several devices.
    #[error("{port:?} matches {} serial ports: {}", matches.len(), matches.join(", "))]
    Ambiguous {
        /// Port name as requested.
        port: String,
        /// Full names of the matching ports.
        matches: Vec<String>,
    },
    /// The partial name matches another device than before.
    #[error("{port:?} matched {before}, which is gone, and now matches {now}")]
    OtherDevice {
        /// Partial name as requested.
        port: String,
        /// Name of the device that was opened before.
        before: String,
        /// Name of the device that matches now.
        now: String,
    },
    /// The stable ids or USB serial numbers can't be looked up.
    #[error("serial port {port:?} can't be looked up: {source}")]
    NotListed {
        /// Port name as requested.
        port: String,
        /// Error of listing the ports.
        source: PortListError,
    },
    /// The port exists, but this user may not open it.
    #[error("no permission to open {0}")]
    Permission(PathBuf),
    /// The control group's device policy denies access despite the file permissions.
    #[error("the device policy of this service or container does not allow {0}")]
    DevicePolicy(PathBuf),
    /// Another program has the port open.
    #[error("{} is in use by another program{}", port.display(), holders.suffix())]
    Busy {
        /// Path of the port.
        port: PathBuf,
        /// Programs that have the port open, as far as visible to this user.
        holders: Holders,
    },
    /// The path is a file, a folder or another kind of device.
    #[error("{0} is not a serial port")]
    NotSerial(PathBuf),
    /// Any other error of the system.
    #[error("cannot open {port}: {source}")]
    Io {
        /// Path of the port.
        port: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// Failure to list the serial ports.
#[derive(Debug, Error)]
#[error("{}: {source}", folder.display())]
pub struct PortListError {
    /// Folder in which the ports were looked up.
    pub folder: PathBuf,
    /// Error of the operating system.
    pub source: io::Error,
}

impl PortListError {
    pub(super) fn new(folder: &Path, source: io::Error) -> Self {
        Self { folder: folder.into(), source }
    }

    /// Suggests a remedy.
    #[must_use]
    pub fn help(&self) -> String {
        exhausted(&self.source).map_or_else(
            || {
                format!(
                    "mount the file system of {} (sysfs, udev), or give the port's path, such as \
                     /dev/ttyACM0",
                    self.folder.display()
                )
            },
            str::to_owned,
        )
    }
}

impl LinkError {
    /// Suggests a remedy.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::NotFound { present: Ok(present), .. } if present.is_empty() => {
                "no serial port is present: plug the board in, or use --mock to try without one"
                    .into()
            }
            Self::NotFound { present: Ok(present), .. } => format!(
                "present are {}; give one of them, or use --mock to try without a board",
                present.join(", ")
            ),
            Self::NotFound { present: Err(error), .. } => format!(
                "plug the board in, or use --mock to try without one; the ports of this computer \
                 can't be listed ({error}): {}",
                error.help()
            ),
            Self::Ambiguous { .. } => "give one of these names in full".into(),
            Self::OtherDevice { before, now, .. } => {
                format!("it was not opened: reconnect {before}, or give {now} in full and restart")
            }
            Self::NotListed { source, .. } => source.help(),
            Self::Permission(port) => format!(
                "add yourself to the group that owns it (`ls -l {}`; usually `sudo usermod -aG \
                 dialout $USER`), then log in again",
                port.display()
            ),
            Self::DevicePolicy(port) => format!(
                "under systemd, allow the driver in a drop-in (`DeviceAllow=char-ttyACM rw`) and \
                 restart the service: a driver that was loaded after the service started is not \
                 allowed yet; in a container, pass {} through",
                port.display()
            ),
            Self::Busy { port, holders } => match holders.remedy(port) {
                Some(advice) => format!("{advice}; `sudo fuser -v {}` lists them", port.display()),
                None => format!(
                    "find the program with `sudo fuser -v {}` and stop it; a running daemon owns \
                     its port",
                    port.display()
                ),
            },
            Self::NotSerial(_) => {
                "give a character device such as /dev/ttyACM0, or the link of a mock".into()
            }
            Self::Io { source, .. } => match Errno::from_io_error(source) {
                Some(Errno::NXIO | Errno::NODEV) => {
                    "the port has a name, but no hardware: give another port, or plug the board in"
                        .into()
                }
                _ => exhausted(source).map_or_else(
                    || "unplug the board, plug it in again, and look at `dmesg`".into(),
                    str::to_owned,
                ),
            },
        }
    }
}

/// Suggests a remedy if a system resource is exhausted.
fn exhausted(error: &io::Error) -> Option<&'static str> {
    match Errno::from_io_error(error)? {
        Errno::MFILE => Some(
            "this process has no file descriptors left: disconnect clients, or raise its limit \
             (`LimitNOFILE=` of the unit, `ulimit -n`)",
        ),
        Errno::NFILE => {
            Some("this computer has no file descriptors left: see `sysctl fs.file-nr fs.file-max`")
        }
        Errno::NOMEM => Some("this computer has no memory left: stop other programs"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exhausted_resource_is_named() {
        for (errno, part) in [
            (Errno::MFILE, "this process has no file descriptors left"),
            (Errno::NFILE, "this computer has no file descriptors left"),
            (Errno::NOENT, "mount the file system of /sys/class/tty"),
        ] {
            let source = PortListError::new(Path::new("/sys/class/tty"), errno.into());
            let error = LinkError::NotListed { port: "Arduino".into(), source };
            assert!(error.help().contains(part), "{}", error.help());
            let text = error.to_string();
            assert!(text.contains("Arduino") && text.contains("/sys/class/tty"), "{text}");
        }
        let error = LinkError::Io { port: "/dev/ttyACM0".into(), source: Errno::MFILE.into() };
        assert!(error.help().contains("LimitNOFILE"), "{}", error.help());
    }

    #[test]
    fn unknown_holder_has_a_remedy() {
        let error = LinkError::Busy { port: "/dev/ttyACM0".into(), holders: Holders::default() };
        assert_eq!(error.to_string(), "/dev/ttyACM0 is in use by another program");
        assert!(error.help().contains("sudo fuser -v /dev/ttyACM0"), "{}", error.help());
        let source = PortListError::new(Path::new("/sys/class/tty"), Errno::MFILE.into());
        let error = LinkError::NotFound { port: "/dev/ttyACM0".into(), present: Err(source) };
        assert!(error.help().contains("no file descriptors left"), "{}", error.help());
    }
}
