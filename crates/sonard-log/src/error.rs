//! What can go wrong with a log, and what to do about it.

use std::{
    io,
    path::{Path, PathBuf},
};

use rustix::{fs::statvfs, io::Errno};
use sonard_records::{EncodeError, SinkError};
use thiserror::Error;

use super::{FileKind, LineError};

/// A log that can't be opened, written, synced or repaired.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The file can't be opened or created.
    #[error("cannot open {}: {source}", path.display())]
    Open {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file can't be opened to read it.
    #[error("cannot open {}: {source}", path.display())]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It is another kind of file.
    #[error("{} is {kind}, not a log", path.display())]
    NoLog {
        /// Which file.
        path: PathBuf,
        /// What it is.
        kind: FileKind,
    },
    /// A session of a log format that this version does not read.
    #[error("cannot read {}: {fault}", path.display())]
    UnsupportedFormat {
        /// Path of the log.
        path: PathBuf,
        /// Line and fault of the session.
        fault: LineError,
    },
    /// Reading failed.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Somebody else holds the log.
    #[error("{} is being written by another process", path.display())]
    Busy {
        /// Which file.
        path: PathBuf,
    },
    /// A record could not be written; nothing of it is in the log, and the log can still be
    /// written to.
    #[error("cannot write to {}: {source}", path.display())]
    Write {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Part of a record was written and could not be taken back; the log ends in a torn line and
    /// takes no more records until it is opened again.
    #[error("cannot write to {}: {source}; its last line is torn", path.display())]
    Torn {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// What was written since the last sync may not be on the disk; the log takes no more
    /// records until it is opened again.
    #[error(
        "cannot sync {}: {source}; {unsynced} record(s) may not be on the disk",
        path.display()
    )]
    Sync {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
        /// Records appended since the last sync that succeeded.
        unsynced: u64,
    },
    /// An earlier failure left the log in doubt.
    #[error("{} takes no more records after an earlier failure", path.display())]
    Failed {
        /// Which file.
        path: PathBuf,
    },
    /// The record itself can't be written down.
    #[error("{}: {source}", path.display())]
    Record {
        /// Which file.
        path: PathBuf,
        /// What is wrong with the record.
        source: EncodeError,
    },
}

impl StoreError {
    /// What the user can do.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Unreadable { source, .. } | Self::Read { source, .. } => {
                help_for_reading(source).into()
            }
            Self::Open { source, path }
            | Self::Write { source, path }
            | Self::Sync { source, path, .. } => help_for(source, path),
            Self::UnsupportedFormat { .. } => {
                "`sonard log verify` lists the lines that this version reads".into()
            }
            Self::NoLog { kind, .. } => kind.instead_of_a_log().into(),
            Self::Busy { .. } => "wait until it is done, stop it, or choose another file".into(),
            Self::Torn { source, path } => {
                format!("{}; then `sonard log repair {}`", help_for(source, path), path.display())
            }
            Self::Failed { .. } => "open it again: that repairs its end".into(),
            Self::Record { .. } => "this is a fault of the program: please report it".into(),
        }
    }

    /// Whether the reader of a pipe went away, which is no failure of the program's.
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
            "that file system has bytes left but no inodes (`df -i`): remove files there; every record before this one \
             is in the log"
        }
        Kind::StorageFull => "make room on that disk: every record before this one is in the log",
        Kind::QuotaExceeded => {
            "the disk quota of this user is used up: raise it or make room; every record before this one is in the log"
        }
        Kind::FileTooLarge => {
            "the file-size limit of this process is reached (`ulimit -f`, LimitFSIZE=): raise it; every record before \
             this one is in the log"
        }
        Kind::NotFound => "check the path; its folder must exist",
        Kind::ReadOnlyFilesystem => {
            "that file system is mounted read-only, perhaps after an error of its disk (`dmesg`): remount it, or \
             choose another place"
        }
        Kind::PermissionDenied => "choose a place where you may write, or change its permissions",
        Kind::IsADirectory => "name a file in that folder",
        Kind::InvalidInput => "move it out of the way, or choose another place",
        _ if is_out_of_descriptors(error) => {
            "no file descriptors are left: close programs, or raise the limit (`ulimit -n`, LimitNOFILE=)"
        }
        _ => "check the disk; every record synced before is in the log",
    }
    .into()
}

/// Whether the file system of a path, or of its folder, can take another file; `true` where that is unknown.
fn has_free_inodes(path: &Path) -> bool {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let stat = statvfs(path).or_else(|_| statvfs(folder.unwrap_or(Path::new("."))));
    // File systems without a fixed count of inodes report none at all.
    stat.map_or(true, |stat| stat.f_files == 0 || stat.f_favail > 0)
}

/// Whether an error is that of a process or system without free file descriptors.
pub(crate) fn is_out_of_descriptors(error: &io::Error) -> bool {
    let errno = error.raw_os_error();
    [Errno::MFILE, Errno::NFILE].iter().any(|limit| errno == Some(limit.raw_os_error()))
}

fn help_for_reading(error: &io::Error) -> &'static str {
    use io::ErrorKind as Kind;
    match error.kind() {
        Kind::NotFound => "check the path",
        Kind::PermissionDenied => "ask its owner for permission to read it, or read a copy",
        Kind::IsADirectory => "name a file in that folder",
        _ => "check the disk; copy what can still be read of it",
    }
}
