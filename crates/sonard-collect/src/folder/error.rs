//! What goes wrong with a collection's folder.

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

/// An error in the folder of a collection.
#[derive(Debug, Error)]
pub enum FolderError {
    /// The system refused.
    #[error("cannot {doing} {}: {source}", path.display())]
    Io {
        /// What was tried.
        doing: &'static str,
        /// With what.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It holds files of other people.
    #[error("{} is not empty, and no collection", path.display())]
    Strange {
        /// The folder.
        path: PathBuf,
    },
    /// Another process collects into it.
    #[error("another process is collecting into this folder: {} is locked", path.display())]
    Busy {
        /// The locked file.
        path: PathBuf,
    },
    /// A file that is not as it was written.
    #[error("{}:{line}: {message}", path.display())]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// Which line, from 1.
        line: u64,
        /// What is wrong.
        message: String,
    },
}

impl FolderError {
    pub(crate) fn io(doing: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { doing, path: path.into(), source }
    }

    /// What a person can do about it.
    #[must_use]
    pub fn help(&self) -> &'static str {
        use io::ErrorKind as Kind;
        match self {
            Self::Io { source, .. } => match source.kind() {
                Kind::StorageFull | Kind::QuotaExceeded | Kind::FileTooLarge => {
                    "make room on that disk and start again: the collection goes on where it stopped"
                }
                Kind::PermissionDenied | Kind::ReadOnlyFilesystem => {
                    "choose a folder that you may write to, or change its permissions"
                }
                _ => "check the path and the disk; what was collected so far is kept",
            },
            Self::Strange { .. } => "give another --out: a collection has a folder of its own",
            Self::Busy { .. } => "wait until it is done, or give another --out",
            Self::Damaged { .. } => {
                "compare the file with a copy: somebody changed it. The scans themselves lie in \
                 scans/ and are good logs without it"
            }
        }
    }
}
