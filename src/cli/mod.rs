//! The command line: one file a verb.

mod compare;
mod failure;
mod log;
mod mock;
mod mock_world;
mod options;
mod paths;
mod picture_file;
mod place;
mod plot;
mod runtime;
mod scan;
mod scene;
mod scene_file;
mod simulate;
mod trace;

pub use failure::{Failure, Outcome};

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Drives an ultrasonic ranger on a stepper, and predicts what it reads.
#[derive(Debug, Parser)]
#[command(version, about, after_help = EXIT_CODES, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 ran and found a failure, 2 wrong usage or input, \
3 device or link.";

#[derive(Debug, Subcommand)]
enum Verb {
    /// Take one or more scans and log each reading beside the model's prediction
    #[command(long_about = scan::ABOUT)]
    Scan(scan::Args),
    /// Play a ranger on a pty, with sound from the model
    #[command(long_about = mock::ABOUT)]
    Mock(mock::Args),
    /// Predict a scan with the model alone
    #[command(long_about = simulate::ABOUT)]
    Simulate(simulate::Args),
    /// List the ways that echoes take from a place
    #[command(long_about = paths::ABOUT)]
    Paths(paths::Args),
    /// Show the echo trace of one firing, each hump with its path
    #[command(long_about = trace::ABOUT)]
    Trace(trace::Args),
    /// Compare a log's readings with the predictions beside them
    Compare(compare::Args),
    /// Draw scans: floor plan, polar, residuals
    #[command(long_about = plot::ABOUT)]
    Plot(plot::Args),
    /// Check, repair or show a log
    #[command(subcommand)]
    Log(log::Verb),
    /// Check or draw a scene file, or print its JSON Schema
    #[command(subcommand)]
    Scene(scene::Verb),
}

/// Runs the command line of this process.
#[must_use]
pub fn main() -> ExitCode {
    let outcome = match Cli::parse().verb {
        Verb::Scan(args) => scan::run(&args),
        Verb::Mock(args) => mock::run(&args),
        Verb::Simulate(args) => simulate::run(&args),
        Verb::Paths(args) => paths::run(&args),
        Verb::Compare(args) => compare::run(&args),
        Verb::Trace(args) => trace::run(&args),
        Verb::Plot(args) => plot::run(&args),
        Verb::Log(verb) => log::run(verb),
        Verb::Scene(verb) => scene::run(verb),
    };
    failure::report(outcome)
}
