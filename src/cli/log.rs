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
    /// Check logs; exit code 0 if all are clean, else 1, with each problem by line
    Verify(verify::Args),
    /// Remove unreadable lines, and keep the original as LOG.orig
    Repair(repair::Args),
    /// Show the contents of a log: sessions, scans, events
    Show(show::Args),
    /// Add Feature Prediction's confidence to every ping of a log
    Annotate(annotate::Args),
    /// Print the JSON Schema of a log's lines (docs/log.md explains them)
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
    /// Converts errors of a path that can't be opened to input failures, and errors of a lock or
    /// disk to device failures.
    fn from(error: StoreError) -> Self {
        match &error {
            StoreError::Unreadable { .. }
            | StoreError::NotALog { .. }
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
