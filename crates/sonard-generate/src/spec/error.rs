//! Errors of a specification.

use std::fmt;

/// Fault in a specification, with its position in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SpecError {
    /// File name, as given by the caller.
    pub file: String,
    /// Line and column from 1, if known.
    pub position: Option<(usize, usize)>,
    /// Path of the field, such as `scene[0].width_m`; empty for the whole file.
    pub field: String,
    /// Description of the fault.
    pub message: String,
    /// Advice for the user, with valid values.
    pub help: String,
}

impl fmt::Display for SpecError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some((line, column)) = self.position {
            write!(f, ":{line}:{column}")?;
        }
        match self.field.is_empty() {
            true => write!(f, ": {}", self.message),
            false => write!(f, ": {}: {}", self.field, self.message),
        }
    }
}

impl std::error::Error for SpecError {}

/// Fault without its position in the file.
#[derive(Debug)]
pub(super) struct SpecFault {
    pub(super) field: String,
    pub(super) message: String,
    pub(super) help: String,
}

impl SpecFault {
    pub(super) fn new(
        field: impl Into<String>,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        Self { field: field.into(), message: message.into(), help: help.into() }
    }
}
