//! Errors of a collection's folder.

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

/// Error in the folder of a collection.
#[derive(Debug, Error)]
pub enum FolderError {
    /// Failed file operation.
    #[error("cannot {doing} {}: {source}", path.display())]
    Io {
        /// Attempted operation, as a verb.
        doing: &'static str,
        /// File or folder of the operation.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Folder with files that are not a collection.
    #[error("{} is not empty and not a collection", path.display())]
    NotACollection {
        /// Path of the folder.
        path: PathBuf,
    },
    /// Folder in use by another process.
    #[error("another process is collecting into this folder: {} is locked", path.display())]
    Busy {
        /// Path of the locked file.
        path: PathBuf,
    },
    /// File whose content was damaged.
    #[error("{}:{line}: {message}", path.display())]
    Damaged {
        /// Path of the damaged file.
        path: PathBuf,
        /// Line number, from 1.
        line: u64,
        /// Description of the damage.
        message: String,
    },
}

impl FolderError {
    pub(crate) fn io(doing: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { doing, path: path.into(), source }
    }

    /// Suggested remedy for the user.
    #[must_use]
    pub fn help(&self) -> &'static str {
        use io::ErrorKind as Kind;
        match self {
            Self::Io { source, .. } => match source.kind() {
                Kind::StorageFull | Kind::QuotaExceeded | Kind::FileTooLarge => {
                    "free space on that disk and run the same command to resume"
                }
                Kind::PermissionDenied | Kind::ReadOnlyFilesystem => {
                    "choose a writable folder, or change its permissions"
                }
                _ => "check the path and the disk; recorded scans are kept",
            },
            Self::NotACollection { .. } => {
                "choose another --out: a collection needs its own folder"
            }
            Self::Busy { .. } => "wait until that process ends, or choose another --out",
            Self::Damaged { .. } => {
                "compare the file with a copy: it was changed. The logs in scans/ are valid \
                 without it"
            }
        }
    }
}
