//! What can be wrong with a specification.

use std::fmt;

/// A fault in a specification, with its place in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SpecError {
    /// The file, as its reader called it.
    pub file: String,
    /// Line and column from 1, where they are known.
    pub place: Option<(usize, usize)>,
    /// Which field, as `scene[0].width_m`; empty for the file as a whole.
    pub field: String,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: String,
}

impl fmt::Display for SpecError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some((line, column)) = self.place {
            write!(f, ":{line}:{column}")?;
        }
        match self.field.is_empty() {
            true => write!(f, ": {}", self.message),
            false => write!(f, ": {}: {}", self.field, self.message),
        }
    }
}

impl std::error::Error for SpecError {}

/// A fault before its place is looked up.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) field: String,
    pub(super) message: String,
    pub(super) help: String,
}

impl Fault {
    pub(super) fn new(
        field: impl Into<String>,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> Self {
        Self { field: field.into(), message: message.into(), help: help.into() }
    }
}
