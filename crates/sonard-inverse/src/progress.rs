//! Progress reporting, checkpointing and cancellation of fits and searches.

use std::fmt;

use crate::fit::Found;

/// Observer of a fit or a search for poses; see [`Unwatched`] for none.
pub trait Watch: Sync {
    /// Reports the progress of a fit.
    fn progress(&self, _progress: Progress) {}

    /// Reports the result of a search as a checkpoint; results given as known are not repeated.
    fn found(&self, _found: &Found) {}

    /// Returns `true` to cancel; polled before each prediction, and must remain `true` once set.
    fn stops(&self) -> bool {
        false
    }
}

/// Observer that does nothing and never cancels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Unwatched;

impl Watch for Unwatched {}

/// Progress of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Continuation from wide to observed scatter: stage out of all, from 1.
    Approaching {
        /// Current stage, from 1.
        spread: usize,
        /// Number of stages in all.
        of: usize,
    },
    /// Restarts near the optimum: start out of all, from 1.
    Searching {
        /// Current start, from 1.
        place: usize,
        /// Number of starts in all.
        of: usize,
    },
}

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Approaching { spread, of } => write!(f, "start {spread} of {of}"),
            Self::Searching { place, of } => write!(f, "restart {place} of {of}"),
        }
    }
}
