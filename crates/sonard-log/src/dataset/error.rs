//! What can go wrong with the folder of a data set.

use std::{
    io,
    path::{Path, PathBuf},
};

use sonard_generate::{ManifestError, ShardError, SpecError};
use thiserror::Error;

/// An error in making or reading a data set.
#[derive(Debug, Error)]
pub enum DataSetError {
    /// The folder is in use for something else.
    #[error("{} holds {name} and no data set", root.display())]
    Strange {
        /// The folder.
        root: PathBuf,
        /// Something in it.
        name: String,
    },
    /// The folder is of another set.
    #[error("{} holds the data set of another specification (its spec.json)", root.display())]
    OtherSet {
        /// The folder.
        root: PathBuf,
    },
    /// What is in a shard's place is another shard.
    #[error("{}: {why}", path.display())]
    Foreign {
        /// The shard's folder.
        path: PathBuf,
        /// What is wrong.
        why: ManifestError,
    },
    /// Something was taken out of a shard.
    #[error("{} lacks {lacks}", path.display())]
    NotWhole {
        /// The shard's folder.
        path: PathBuf,
        /// What it lacks.
        lacks: String,
    },
    /// The specification of a set has a fault.
    #[error(transparent)]
    Specification(#[from] SpecError),
    /// A shard can't be made.
    #[error("shard {shard}: {error}")]
    Shard {
        /// Its number.
        shard: u32,
        /// Why.
        error: ShardError,
    },
    /// A file or folder can't be read or written.
    #[error("cannot {what} {}: {source}", path.display())]
    Io {
        /// What was tried: `read`, `write`, `make`.
        what: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl DataSetError {
    pub(super) fn io(what: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { what, path: path.into(), source }
    }

    /// What to do.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Strange { .. } | Self::OtherSet { .. } => {
                "give an empty or a new folder; one set, one folder".to_owned()
            }
            Self::Foreign { .. } => {
                "give another folder, or remove that shard: it is made anew".to_owned()
            }
            Self::NotWhole { .. } => "remove that folder: the shard is made anew".to_owned(),
            Self::Specification(error) => error.help.clone(),
            Self::Shard { error: ShardError::DoesNotFit { .. }, .. } => {
                "mend the specification: the same is drawn each time".to_owned()
            }
            Self::Shard { error: ShardError::Model { .. }, .. } => {
                "mend the specification, its sections [model], [sensor] and [heights]".to_owned()
            }
            Self::Shard { error: ShardError::Number { .. }, .. } => {
                "give numbers from 1 on".to_owned()
            }
            Self::Shard { error: ShardError::Write(_), .. } | Self::Io { .. } => {
                "check free space and permissions; begin again: shards that are there stay"
                    .to_owned()
            }
        }
    }

    /// The refusal of the disk behind it, if that is what it is.
    #[must_use]
    pub const fn of_disk(&self) -> Option<&io::Error> {
        match self {
            Self::Io { source, .. } | Self::Shard { error: ShardError::Write(source), .. } => {
                Some(source)
            }
            _ => None,
        }
    }
}
