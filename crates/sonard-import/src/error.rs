//! What can be wrong with a file that is imported.

use std::fmt;

use thiserror::Error;

/// Where in a file something stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Location {
    /// A line, from 1.
    Line(u64),
    /// A message of a recording, from 1, among those of readings.
    Message(u64),
    /// An object of a JSON file, and one of the numbers in its lists, both from 1.
    Entry {
        /// The object.
        object: u64,
        /// The place in its lists; `None` of what it has once.
        number: Option<u64>,
    },
}

impl fmt::Display for Location {
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

/// Why a file can't be imported.
#[derive(Debug, Error)]
pub enum ImportError {
    /// The system refused.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// A place in the file holds what it should not.
    #[error("{place}{}: {what}", column.as_ref().map(|column| format!(", {column}")).unwrap_or_default())]
    At {
        /// Where.
        place: Location,
        /// The field, and the column that it was looked for in.
        column: Option<String>,
        /// What is wrong.
        what: String,
        /// What to do.
        help: String,
    },
    /// The mapping does not fit the file, or makes no sense by itself.
    #[error("{what}")]
    Mapping {
        /// What is wrong.
        what: String,
        /// What to do.
        help: String,
    },
    /// The numbers are not what the mapping says they are.
    #[error("{what}")]
    Doubtful {
        /// What speaks against it.
        what: String,
        /// What they may be instead.
        help: String,
    },
}

impl ImportError {
    pub(crate) fn mapping(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Mapping { what: what.into(), help: help.into() }
    }

    pub(crate) fn at(place: Location, what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::At { place, column: None, what: what.into(), help: help.into() }
    }

    /// What to do about it.
    #[must_use]
    pub fn help(&self) -> &str {
        match self {
            Self::Io(_) => "check the file",
            Self::At { help, .. } | Self::Mapping { help, .. } | Self::Doubtful { help, .. } => {
                help
            }
        }
    }
}
