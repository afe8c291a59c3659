//! Errors of logs, with remedies.

use std::{
    io,
    path::{Path, PathBuf},
};

use sonard_records::{EncodeError, SinkError};
use thiserror::Error;

use super::{Displacement, FileKind, LineError, platform};

/// Error in opening, reading, writing, syncing or repairing a log.
#[derive(Debug, Error)]
pub enum StoreError {
    /// Failure to open or create the file for writing.
    #[error("cannot open {}: {source}", path.display())]
    Open {
        /// Path of the log.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Failure to open the file for reading.
    #[error("cannot open {}: {source}", path.display())]
    Unreadable {
        /// Path of the log.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// File of another kind.
    #[error("{} is {kind}, not a log", path.display())]
    NotALog {
        /// Path of the file.
        path: PathBuf,
        /// Detected kind of the file.
        kind: FileKind,
    },
    /// Session of a log format that this version does not read.
    #[error("cannot read {}: {fault}", path.display())]
    UnsupportedFormat {
        /// Path of the log.
        path: PathBuf,
        /// Line and fault of the session.
        fault: LineError,
    },
    /// Failure to read the file.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Path of the log.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Log locked by another process.
    #[error("{} is being written by another process", path.display())]
    Busy {
        /// Path of the log.
        path: PathBuf,
    },
    /// Failure to write a record. No part of the record is in the log, and the log remains
    /// writable.
    #[error("cannot write to {}: {source}", path.display())]
    Write {
        /// Path of the log.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Partially written record that could not be removed. The log ends in a torn line and rejects
    /// records until it is reopened.
    #[error("cannot write to {}: {source}; its last line is torn", path.display())]
    Torn {
        /// Path of the log.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Failed sync: records since the last sync may not be on the disk. The log rejects records
    /// until it is reopened.
    #[error(
        "cannot sync {}: {source}; {unsynced} record(s) may not be on the disk",
        path.display()
    )]
    Sync {
        /// Path of the log.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
        /// Number of records appended since the last successful sync.
        unsynced: u64,
    },
    /// Log that was removed, moved or changed by another program while it was written.
    #[error("{} {displacement} while it was written", path.display())]
    Displaced {
        /// Path of the log.
        path: PathBuf,
        /// Difference between the written log and the file at its path.
        displacement: Displacement,
    },
    /// Log that rejects records after an earlier failure.
    #[error("{} rejects records after an earlier failure", path.display())]
    Failed {
        /// Path of the log.
        path: PathBuf,
    },
    /// Record that cannot be encoded.
    #[error("{}: {source}", path.display())]
    Record {
        /// Path of the log.
        path: PathBuf,
        /// Fault of the record.
        source: EncodeError,
    },
}

impl StoreError {
    /// Suggested remedy for the user.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Unreadable { source, .. } | Self::Read { source, .. } => {
                help_for_reading(source).into()
            }
            Self::Open { source, path }
            | Self::Write { source, path }
            | Self::Sync { source, path, .. } => help_for(source, path),
            Self::UnsupportedFormat { .. } => "`sonard log verify` lists the readable lines".into(),
            Self::NotALog { kind, .. } => kind.help_for_log().into(),
            Self::Busy { .. } => {
                "wait until that process ends, stop it, or choose another file".into()
            }
            Self::Torn { source, path } => {
                format!("{}; then `sonard log repair {}`", help_for(source, path), path.display())
            }
            Self::Displaced { displacement: Displacement::Moved, .. } => {
                "the records are in the moved file".into()
            }
            Self::Displaced { .. } => {
                "take the scan again, and leave its folder alone until the end".into()
            }
            Self::Failed { .. } => "reopen the log: that repairs its end".into(),
            Self::Record { .. } => "this is a bug of the program: please report it".into(),
        }
    }

    /// Returns `true` for a closed pipe, which is not a failure of the program.
    #[must_use]
    pub fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Write { source, .. } | Self::Torn { source, .. } | Self::Sync { source, .. }
            if source.kind() == io::ErrorKind::BrokenPipe)
    }
}

impl From<StoreError> for SinkError {
    fn from(error: StoreError) -> Self {
        let help = error.help();
        Self::new(error, help)
    }
}

fn help_for(error: &io::Error, path: &Path) -> String {
    use io::ErrorKind as Kind;
    match error.kind() {
        Kind::StorageFull if !has_free_inodes(path) => {
            "the file system has free space but no inodes (`df -i`): remove files there; all earlier \
             records are in the log"
        }
        Kind::StorageFull => "free space on that disk; all earlier records are in the log",
        Kind::QuotaExceeded => {
            "the disk quota of this user is used up: raise it or free space; all earlier records are in \
             the log"
        }
        Kind::FileTooLarge => {
            "the file-size limit of this process is reached (`ulimit -f`, LimitFSIZE=): raise it; all \
             earlier records are in the log"
        }
        Kind::NotFound => "check the path; its folder must exist",
        Kind::ReadOnlyFilesystem => {
            "the file system is mounted read-only, perhaps after a disk error (`dmesg`): remount it, or \
             choose another folder"
        }
        Kind::PermissionDenied => "choose a writable folder, or change its permissions",
        Kind::IsADirectory => "name a file in that folder",
        Kind::InvalidInput => "move that file away, or choose another path",
        _ if platform::is_out_of_descriptors(error) => {
            "no file descriptors are left: close programs, or raise the limit (`ulimit -n`, LimitNOFILE=)"
        }
        _ => "check the disk; all synced records are in the log",
    }
    .into()
}

/// Returns `true` if the file system of a path, or of its folder, has a free inode or does not
/// report inodes.
fn has_free_inodes(path: &Path) -> bool {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let found = platform::has_free_inodes(path);
    found.or_else(|_| platform::has_free_inodes(folder.unwrap_or(Path::new(".")))).unwrap_or(true)
}

fn help_for_reading(error: &io::Error) -> &'static str {
    use io::ErrorKind as Kind;
    match error.kind() {
        Kind::NotFound => "check the path",
        Kind::PermissionDenied => "request permission to read it from its owner, or read a copy",
        Kind::IsADirectory => "name a file in that folder",
        _ => "check the disk; copy the files that are still readable",
    }
}
