//! `sonard log`.

mod annotate;
mod repair;
pub(super) mod rewrite;
mod show;
mod verify;

use crate::store::StoreError;

use super::{Failure, Outcome};

/// Verbs of `sonard log`.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Verb {
    /// Check logs: exit code 0 if all are clean, 1 if not, with what and where by line
    Verify(verify::Args),
    /// Leave out what can't be read and keep the original beside it
    Repair(repair::Args),
    /// Show what is in a log: sessions, scans, events
    Show(show::Args),
    /// Write a log again with Feature Prediction's confidence in every ping
    Annotate(annotate::Args),
}

pub(super) fn run(verb: Verb) -> Outcome {
    match verb {
        Verb::Verify(args) => verify::run(&args),
        Verb::Repair(args) => repair::run(&args),
        Verb::Show(args) => show::run(&args),
        Verb::Annotate(args) => annotate::run(&args),
    }
}

impl From<StoreError> for Failure {
    /// A path that can't be opened is wrong input; a lock or a disk that fails is not.
    fn from(error: StoreError) -> Self {
        match &error {
            StoreError::Open { .. } | StoreError::Unreadable { .. } | StoreError::NoLog { .. } => {
                Self::input(&error, error.help())
            }
            _ => Self::device(&error, error.help()),
        }
    }
}
