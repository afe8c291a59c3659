//! Synchronisation of files and folders with the disk.
//!
//! Some file systems (CIFS, several of FUSE, shared folders of virtual machines) have no fsync(2) of folders, or none at
//! all. What is written there survives the end of the program, only not a loss of power, so that a missing operation is
//! a warning and no error.

use std::{
    fs::File,
    io,
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
};

use rustix::io::Errno;

/// Brings a file's content to the disk.
///
/// # Errors
/// As the system reports, unless the file system has no such operation.
pub fn sync_file(file: &File) -> io::Result<()> {
    static REPORTED: AtomicBool = AtomicBool::new(false);
    unless_unsupported(file.sync_data(), &REPORTED, "files")
}

/// Brings the entries of the folder of `path` to the disk, so that a new or renamed file keeps its name.
///
/// # Errors
/// As the system reports, unless the file system has no such operation, or this user may not read the folder.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    sync_folder(folder.unwrap_or(Path::new(".")))
}

/// Brings the entries of a folder to the disk.
///
/// # Errors
/// As [`sync_folder_of`].
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    static REPORTED: AtomicBool = AtomicBool::new(false);
    let synced = match File::open(folder) {
        Ok(folder) => folder.sync_all(),
        // A folder may allow new files and not to be listed.
        Err(error) if error.kind() == io::ErrorKind::PermissionDenied => Ok(()),
        Err(error) => Err(error),
    };
    unless_unsupported(synced, &REPORTED, "folders")
}

/// Turns the error of a file system that lacks an operation into one warning of this process.
fn unless_unsupported(
    outcome: io::Result<()>,
    reported: &AtomicBool,
    what: &str,
) -> io::Result<()> {
    let Err(error) = &outcome else { return outcome };
    if !error.raw_os_error().is_some_and(is_unsupported) {
        return outcome;
    }
    if !reported.swap(true, Ordering::Relaxed) {
        tracing::warn!(
            "this file system can't sync {what} ({error}): records survive the end of the program, but not a loss of \
             power; a local disk keeps both"
        );
    }
    Ok(())
}

/// Whether an error of fsync(2) or flock(2) is that of a file system without the operation.
pub(super) fn is_unsupported(errno: i32) -> bool {
    let unsupported = [Errno::INVAL, Errno::NOSYS, Errno::OPNOTSUPP, Errno::NOTSUP, Errno::NOTTY];
    unsupported.iter().any(|known| known.raw_os_error() == errno)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(errno: Errno) -> io::Result<()> {
        unless_unsupported(Err(errno.into()), &AtomicBool::new(true), "files")
    }

    #[test]
    fn missing_operations_are_no_errors() {
        for errno in [Errno::INVAL, Errno::NOSYS, Errno::OPNOTSUPP] {
            assert!(outcome(errno).is_ok(), "{errno}");
        }
        for errno in [Errno::IO, Errno::NOSPC, Errno::DQUOT, Errno::ROFS] {
            assert!(outcome(errno).is_err(), "{errno}");
        }
    }

    #[test]
    fn folders_that_can_be_synced_are() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(sync_folder_of(&folder.path().join("log")).is_ok());
        assert!(sync_folder_of(&folder.path().join("missing/log")).is_err());
        assert!(sync_folder_of(Path::new("log")).is_ok());
    }
}
