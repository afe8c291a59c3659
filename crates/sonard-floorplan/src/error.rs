//! Error of reading a floor plan.

use std::{fmt, path::PathBuf};

/// Invalid or ambiguous floor plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlanError {
    /// File that a world includes and that has the fault; `None` for the given file.
    pub file: Option<PathBuf>,
    what: String,
    help: String,
}

impl PlanError {
    pub(crate) fn new(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self { file: None, what: what.into(), help: help.into() }
    }

    /// Returns advice for the user.
    #[must_use]
    pub fn help(&self) -> &str {
        &self.help
    }
}

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

impl std::error::Error for PlanError {}
