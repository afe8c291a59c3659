//! Errors of a data set's folder.

use std::{
    io,
    path::{Path, PathBuf},
};

use sonard_generate::{ManifestError, ShardError, SpecError};
use thiserror::Error;

/// Error in generating or reading a data set.
#[derive(Debug, Error)]
pub enum DataSetError {
    /// Folder that is used for other files.
    #[error("{} contains {name} and is not a data set", root.display())]
    NotADataSet {
        /// Path of the folder.
        root: PathBuf,
        /// Name of a file in the folder.
        name: String,
    },
    /// Folder of a data set with another specification.
    #[error("{} contains the data set of another specification (spec.json)", root.display())]
    OtherSet {
        /// Path of the folder.
        root: PathBuf,
    },
    /// Shard folder with a different shard.
    #[error("{}: {why}", path.display())]
    Foreign {
        /// Path of the shard's folder.
        path: PathBuf,
        /// Mismatch with the expected shard.
        why: ManifestError,
    },
    /// Incomplete shard.
    #[error("{} lacks {lacks}", path.display())]
    Incomplete {
        /// Path of the shard's folder.
        path: PathBuf,
        /// Missing file or size.
        lacks: String,
    },
    /// Fault in the specification of a set.
    #[error(transparent)]
    Specification(#[from] SpecError),
    /// Failure to generate a shard.
    #[error("shard {shard}: {error}")]
    Shard {
        /// Number of the shard.
        shard: u32,
        /// Cause of the failure.
        error: ShardError,
    },
    /// Failure to read or write a file or folder.
    #[error("cannot {what} {}: {source}", path.display())]
    Io {
        /// Attempted operation: `read`, `write` or `create`.
        what: &'static str,
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl DataSetError {
    pub(super) fn io(what: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { what, path: path.into(), source }
    }

    /// Suggested remedy for the user.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::NotADataSet { .. } | Self::OtherSet { .. } => {
                "choose an empty or a new folder: each set needs its own folder".to_owned()
            }
            Self::Foreign { .. } => {
                "choose another folder, or remove that shard to regenerate it".to_owned()
            }
            Self::Incomplete { .. } => "remove that folder to regenerate the shard".to_owned(),
            Self::Specification(error) => error.help.clone(),
            Self::Shard { error: ShardError::DoesNotFit { .. }, .. } => {
                "correct the specification: a retry draws the same values".to_owned()
            }
            Self::Shard { error: ShardError::Model { .. }, .. } => {
                "correct the specification in [model], [sensor] or [heights]".to_owned()
            }
            Self::Shard { error: ShardError::Number { .. }, .. } => "use numbers from 1".to_owned(),
            Self::Shard { error: ShardError::Write(_), .. } | Self::Io { .. } => {
                "check free space and permissions, then run the command again: existing shards are \
                 kept"
                    .to_owned()
            }
        }
    }

    /// Returns the error of the operating system, if that is the cause.
    #[must_use]
    pub const fn io_error(&self) -> Option<&io::Error> {
        match self {
            Self::Io { source, .. } | Self::Shard { error: ShardError::Write(source), .. } => {
                Some(source)
            }
            _ => None,
        }
    }
}
