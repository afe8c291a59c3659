//! Where a value was given, and what is wrong with it.

use std::fmt;

use thiserror::Error;

/// Source of a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// In a file, at this line and column (from 1).
    File {
        /// Its name.
        file: String,
        /// Line.
        line: usize,
        /// Column, characters.
        column: usize,
    },
    /// In the environment variable of this name.
    Environment(String),
    /// By this option of the command line.
    Option(String),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { file, line, column } => write!(f, "{file}:{line}:{column}"),
            Self::Environment(name) => f.write_str(name),
            Self::Option(option) => f.write_str(option),
        }
    }
}

/// An error in the configuration.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{origin}: {message}")]
pub struct ConfigError {
    /// Where.
    pub origin: Origin,
    /// What.
    pub message: String,
    /// What would be right.
    pub help: String,
}
