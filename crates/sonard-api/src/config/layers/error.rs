//! Configuration errors and their source positions.

use std::fmt;

use thiserror::Error;

/// Source of a configuration value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// Position in a file, counted from 1.
    File {
        /// Name of the file.
        file: String,
        /// Line, counted from 1.
        line: usize,
        /// Column, characters, counted from 1.
        column: usize,
    },
    /// Environment variable of this name.
    Environment(String),
    /// Command line option.
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

/// Error in the configuration, with its position.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{origin}: {message}")]
pub struct ConfigError {
    /// Source of the invalid value.
    pub origin: Origin,
    /// Description of the error.
    pub message: String,
    /// Advice on how to correct the error.
    pub help: String,
}
