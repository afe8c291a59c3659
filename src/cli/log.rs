//! `sonard log`.

use super::{Failure, Outcome};

/// Verbs of `sonard log`.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Verb {
    /// Check a file
    Check,
}

pub(super) fn run(_verb: Verb) -> Outcome {
    Err(Failure::Found(None))
}
