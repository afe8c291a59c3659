//! Import errors and the position in the file that they refer to.

use std::fmt;

use thiserror::Error;

/// Position of a reading or an error within a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileLocation {
    /// Line number, from 1.
    Line(u64),
    /// Message of a recording, from 1, counting only messages with readings.
    Message(u64),
    /// Object of a JSON file, optionally with an element of its lists, both from 1.
    Entry {
        /// Number of the object, from 1.
        object: u64,
        /// Index within the lists of the object, from 1; `None` for values that are not in a list.
        number: Option<u64>,
    },
}

impl fmt::Display for FileLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Message(message) => write!(f, "message {message}"),
            Self::Entry { object, number: None } => write!(f, "object {object}"),
            Self::Entry { object, number: Some(number) } => {
                write!(f, "object {object}, number {number} of its lists")
            }
        }
    }
}

/// Error of examining or converting a file.
#[derive(Debug, Error)]
pub enum ImportError {
    /// I/O error of the operating system.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// Invalid value at a position in the file.
    #[error("{place}{}: {what}", column.as_ref().map(|column| format!(", {column}")).unwrap_or_default())]
    At {
        /// Position of the invalid value.
        place: FileLocation,
        /// Field, and the column mapped to it.
        column: Option<String>,
        /// Description of the fault.
        what: String,
        /// Advice for the user, with the option that resolves the fault.
        help: String,
    },
    /// Mapping that is inconsistent or does not fit the file.
    #[error("{what}")]
    Mapping {
        /// Description of the fault.
        what: String,
        /// Advice for the user, with the option that resolves the fault.
        help: String,
    },
    /// Values that are implausible for the mapped quantity or unit.
    #[error("{what}")]
    Implausible {
        /// Evidence against the mapping.
        what: String,
        /// Alternative interpretations, each with its option.
        help: String,
    },
}

impl ImportError {
    pub(crate) fn mapping(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Mapping { what: what.into(), help: help.into() }
    }

    pub(crate) fn at(
        place: FileLocation,
        what: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        Self::At { place, column: None, what: what.into(), help: help.into() }
    }

    /// Returns advice for the user, with the option that resolves the error.
    #[must_use]
    pub fn help(&self) -> &str {
        match self {
            Self::Io(_) => "check the file",
            Self::At { help, .. } | Self::Mapping { help, .. } | Self::Implausible { help, .. } => {
                help
            }
        }
    }
}
