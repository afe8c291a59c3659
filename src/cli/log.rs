//! `sonard log`.

mod annotate;
mod repair;
pub(super) mod rewrite;
mod show;
mod verify;

use std::io::{self, Write as _};

use crate::{scan::Record, store::StoreError};

use super::{Failure, Outcome, failure::is_wrong_place};

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
    /// Print the JSON Schema of a log's lines (docs/log.md says what they mean)
    Schema,
}

pub(super) fn run(verb: Verb) -> Outcome {
    match verb {
        Verb::Verify(args) => verify::run(&args),
        Verb::Repair(args) => repair::run(&args),
        Verb::Show(args) => show::run(&args),
        Verb::Annotate(args) => annotate::run(&args),
        Verb::Schema => schema(),
    }
}

fn schema() -> Outcome {
    let schema = schemars::schema_for!(Record);
    let printed = serde_json::to_string_pretty(&schema)
        .map_err(io::Error::from)
        .and_then(|text| writeln!(io::stdout(), "{text}"));
    printed.or_else(|error| Failure::from_write("standard output", &error))
}

impl From<StoreError> for Failure {
    /// A path that can't be opened is wrong input; a lock or a disk that fails is not, wherever it is.
    fn from(error: StoreError) -> Self {
        match &error {
            StoreError::Unreadable { .. }
            | StoreError::NoLog { .. }
            | StoreError::UnsupportedFormat { .. } => Self::input(&error, error.help()),
            StoreError::Open { source, .. } | StoreError::Write { source, .. }
                if is_wrong_place(source) =>
            {
                Self::input(&error, error.help())
            }
            _ => Self::device(&error, error.help()),
        }
    }
}
