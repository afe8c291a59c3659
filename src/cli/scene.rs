//! `sonard scene`.

use super::{Failure, Outcome};

/// Verbs of `sonard scene`.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Verb {
    /// Check a file
    Check,
}

pub(super) fn run(_verb: Verb) -> Outcome {
    Err(Failure::Found(None))
}
