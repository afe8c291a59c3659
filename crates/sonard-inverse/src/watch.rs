//! Who watches long work: hears how far it has come, keeps what was found, and may stop it.

use std::fmt;

use crate::fit::Found;

/// Watches a fit or a search for poses; whoever wants nothing of it is [`Unwatched`].
pub trait Watch: Sync {
    /// How far a fit has come.
    fn progress(&self, _progress: Progress) {}

    /// One of a fit's searches is done; those that were given to it as known are not told again.
    fn found(&self, _found: &Found) {}

    /// Whether to stop, asked before each prediction; once it says so it is to stay with it.
    fn stops(&self) -> bool {
        false
    }
}

/// A [`Watch`] that does nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Unwatched;

impl Watch for Unwatched {}

/// Progress of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Goes from wide spreads of readings to the ones that they have: which of so many it is at, from 1.
    Approaching {
        /// Which.
        spread: usize,
        /// Of so many.
        of: usize,
    },
    /// Searches beside where it ended: which of so many places it is at, from 1.
    Searching {
        /// Which.
        place: usize,
        /// Of so many.
        of: usize,
    },
}

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Approaching { spread, of } => write!(f, "spread {spread} of {of}"),
            Self::Searching { place, of } => write!(f, "place {place} of {of} beside the fit"),
        }
    }
}
