//! Pseudo-terminal that acts as the board's serial port.

use std::{
    ffi::CStr,
    fs, io,
    os::{
        fd::{AsFd, BorrowedFd, OwnedFd},
        unix::ffi::OsStrExt as _,
    },
    path::{Path, PathBuf},
};

use rustix::{
    fs::{Mode, OFlags},
    pty::{grantpt, ptsname, unlockpt},
    termios::{OptionalActions, tcgetattr, tcsetattr},
};

use crate::platform::{is_pseudo_terminal, open_terminal_pair};

/// Both ends of a pty, and an optional symbolic link to it.
#[derive(Debug)]
pub struct Pty {
    master: OwnedFd,
    /// Held open so that the master gets no hangup between two users of the port.
    slave: OwnedFd,
    path: PathBuf,
    link: Option<PathBuf>,
}

impl Pty {
    /// Opens a pty in raw mode and points `link` at it.
    ///
    /// # Errors
    /// Any system error; `AlreadyExists` if `link` exists and is not a link left by a mock.
    pub fn open(link: Option<&Path>) -> io::Result<Self> {
        let master = open_terminal_pair()?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?;
        let slave = open_raw(&name)?;
        rustix::io::ioctl_fionbio(&master, true)?;
        let path = PathBuf::from(std::ffi::OsStr::from_bytes(name.as_bytes()));
        if let Some(link) = link {
            create_link(link, &path)?;
        }
        Ok(Self { master, slave, path, link: link.map(Path::to_path_buf) })
    }

    /// Path for hosts: the link if there is one.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.link.as_deref().unwrap_or(&self.path)
    }

    /// Reads bytes from the host; `WouldBlock` if there are none.
    ///
    /// # Errors
    /// As read(2).
    pub fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        Ok(rustix::io::read(&self.master, buffer)?)
    }

    /// Writes to the host; `WouldBlock` if it does not read.
    ///
    /// # Errors
    /// As write(2).
    pub fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        Ok(rustix::io::write(&self.master, bytes)?)
    }

    /// Clears the exclusive mode that a killed program left on the port.
    ///
    /// A process killed before it could close leaves the terminal in exclusive mode for as long
    /// as the master lives; only a slave descriptor can clear it.
    pub fn clear_exclusive(&self) {
        // A closed slave has no lock either.
        let _ = rustix::termios::ioctl_tiocnxcl(&self.slave);
    }
}

impl AsFd for Pty {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.master.as_fd()
    }
}

impl std::os::fd::AsRawFd for Pty {
    fn as_raw_fd(&self) -> std::os::fd::RawFd {
        self.master.as_raw_fd()
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        if let Some(link) = &self.link
            && fs::read_link(link).is_ok_and(|target| target == self.path)
        {
            // A failure to remove the link can't be handled any further.
            drop(fs::remove_file(link));
        }
    }
}

/// Opens the slave in raw mode. A new pty is cooked: it would echo the device's own bytes and turn
/// LF into CRLF.
fn open_raw(name: &CStr) -> io::Result<OwnedFd> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let slave = rustix::fs::open(name, flags, Mode::empty())?;
    let mut settings = tcgetattr(&slave)?;
    settings.make_raw();
    tcsetattr(&slave, OptionalActions::Now, &settings)?;
    Ok(slave)
}

/// Points `link` at `target`, replacing a link to a terminal that an earlier mock left.
fn create_link(link: &Path, target: &Path) -> io::Result<()> {
    match fs::symlink_metadata(link) {
        Ok(there) if there.is_symlink() && leads_to_terminal(link) => fs::remove_file(link)?,
        Ok(_) => {
            return Err(io::Error::new(
                io::ErrorKind::AlreadyExists,
                format!("{} exists and is not a link that a mock left", link.display()),
            ));
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    std::os::unix::fs::symlink(target, link)
}

fn leads_to_terminal(link: &Path) -> bool {
    fs::read_link(link).is_ok_and(|to| is_pseudo_terminal(&to))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{io::Write as _, time::Duration};

    #[test]
    fn pty_is_raw() {
        let pty = Pty::open(None).expect("a pty");
        let mut host = fs::OpenOptions::new().write(true).open(pty.path()).expect("opens");
        host.write_all(b"\x00\x0a\x0d\x03\xff").expect("writes");
        std::thread::sleep(Duration::from_millis(20));
        let mut buffer = [0; 16];
        let read = pty.read(&mut buffer).expect("reads");
        assert_eq!(&buffer[..read], b"\x00\x0a\x0d\x03\xff");
        assert_eq!(
            pty.read(&mut buffer).expect_err("nothing more").kind(),
            io::ErrorKind::WouldBlock
        );
    }

    #[test]
    fn link_replaces_only_stale_links() {
        let folder = tempfile::tempdir().expect("a folder");
        let link = folder.path().join("ranger");
        std::os::unix::fs::symlink("/dev/pts/no-such", &link).expect("a stale link");
        let pty = Pty::open(Some(&link)).expect("a pty");
        assert_eq!(fs::read_link(&link).expect("a link"), pty.path);
        drop(pty);
        assert!(fs::symlink_metadata(&link).is_err(), "the link is gone");

        fs::write(&link, "data").expect("a file");
        let error = Pty::open(Some(&link)).expect_err("a file is in the way");
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read(&link).expect("kept"), b"data");
        let other = folder.path().join("current");
        std::os::unix::fs::symlink(&link, &other).expect("a foreign link");
        let error = Pty::open(Some(&other)).expect_err("a foreign link is in the way");
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read_link(&other).expect("kept"), link);
    }
}
