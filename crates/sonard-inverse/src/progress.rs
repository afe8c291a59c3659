//! Progress reporting, checkpointing and cancellation of fits and searches.

use std::fmt;

use crate::fit::SearchResult;

/// Observer of a fit or a search for poses; see [`NoObserver`] for none.
pub trait FitObserver: Sync {
    /// Reports the progress of a fit.
    fn progress(&self, _progress: FitProgress) {}

    /// Reports the result of a search as a checkpoint; results given as known are not repeated.
    fn found(&self, _found: &SearchResult) {}

    /// Returns `true` to cancel; polled before each prediction, and must remain `true` once set.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Observer that does nothing and never cancels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct NoObserver;

impl FitObserver for NoObserver {}

/// Progress of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FitProgress {
    /// Continuation from wide to observed scatter: stage out of all, from 1.
    Continuation {
        /// Current stage, from 1.
        stage: usize,
        /// Number of stages in all.
        of: usize,
    },
    /// Restarts near the optimum: start out of all, from 1.
    Restart {
        /// Current start, from 1.
        start: usize,
        /// Number of starts in all.
        of: usize,
    },
}

impl fmt::Display for FitProgress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Continuation { stage: spread, of } => write!(f, "start {spread} of {of}"),
            Self::Restart { start: place, of } => write!(f, "restart {place} of {of}"),
        }
    }
}
