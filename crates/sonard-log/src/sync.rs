//! Synchronisation of files and folders with the disk.
//!
//! Some file systems (CIFS, several of FUSE, shared folders of virtual machines) have no fsync(2)
//! for folders, or none at all. Data written there survives the end of the program but not a power
//! failure, so a missing operation is a warning, not an error.

use std::{
    fs::File,
    io,
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
};

use super::platform::{is_unsupported, open_folder};

/// Syncs the content of a file.
///
/// # Errors
/// Returns the error of the system, unless the file system lacks the operation.
pub fn sync_file(file: &File) -> io::Result<()> {
    static REPORTED: AtomicBool = AtomicBool::new(false);
    unless_unsupported(file.sync_data(), &REPORTED, "files")
}

/// Syncs the folder that contains `path`, so that a new or renamed file keeps its name.
///
/// # Errors
/// Returns the error of the system, unless the file system lacks the operation or this user may not
/// read the folder.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    sync_folder(folder.unwrap_or(Path::new(".")))
}

/// Syncs the entries of a folder.
///
/// # Errors
/// Returns the error of the system, with the exceptions of [`sync_folder_of`].
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    static REPORTED: AtomicBool = AtomicBool::new(false);
    let synced = match open_folder(folder) {
        Ok(folder) => folder.sync_all(),
        // A folder may be writable but not readable.
        Err(error) if error.kind() == io::ErrorKind::PermissionDenied => Ok(()),
        Err(error) => Err(error),
    };
    unless_unsupported(synced, &REPORTED, "folders")
}

/// Replaces the error of a missing operation with one warning per process.
fn unless_unsupported(
    outcome: io::Result<()>,
    reported: &AtomicBool,
    what: &str,
) -> io::Result<()> {
    let Err(error) = &outcome else { return outcome };
    if !is_unsupported(error) {
        return outcome;
    }
    if !reported.swap(true, Ordering::Relaxed) {
        tracing::warn!(
            "this file system cannot sync {what} ({error}): records survive the end of the program, \
             but not a power failure; use a local disk for both"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use rustix::io::Errno;

    use super::*;

    fn outcome(errno: Errno) -> io::Result<()> {
        unless_unsupported(Err(errno.into()), &AtomicBool::new(true), "files")
    }

    #[test]
    fn missing_operations_are_ignored() {
        for errno in [Errno::INVAL, Errno::NOSYS, Errno::OPNOTSUPP] {
            assert!(outcome(errno).is_ok(), "{errno}");
        }
        for errno in [Errno::IO, Errno::NOSPC, Errno::DQUOT, Errno::ROFS] {
            assert!(outcome(errno).is_err(), "{errno}");
        }
    }

    #[test]
    fn syncs_existing_folders() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(sync_folder_of(&folder.path().join("log")).is_ok());
        assert!(sync_folder_of(&folder.path().join("missing/log")).is_err());
        assert!(sync_folder_of(Path::new("log")).is_ok());
    }
}
