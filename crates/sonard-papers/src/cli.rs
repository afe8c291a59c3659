//! Command line of `sonard-papers`.

mod answer;
mod benchmark;
mod explore;
mod failure;
mod input;
mod interpret;
mod map;
mod output;
mod progress;
mod rooms;
mod score;
mod views;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

pub(crate) use failure::{Failure, Outcome};

/// Text of `--version` after the name.
const LONG_VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\ncommit ", env!("SONARD_COMMIT"));

/// Repeats the experiments of the papers on simulated rooms
#[derive(Debug, Parser)]
#[command(version, long_version = LONG_VERSION, about, max_term_width = 100, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 stopped before everything was explored, 2 wrong usage or input, 3 write error.";

#[derive(Debug, Subcommand)]
enum Verb {
    /// Evaluate maps, interpretations and explorations with the metrics of the papers
    #[command(subcommand)]
    Benchmark(benchmark::Verb),
    /// Explore a scene with a simulated robot and map it with lines
    #[command(long_about = explore::ABOUT)]
    Explore(explore::Args),
}

/// Runs the command line of this process.
pub(crate) fn main() -> ExitCode {
    let outcome = match Cli::parse().verb {
        Verb::Benchmark(verb) => benchmark::run(verb),
        Verb::Explore(args) => explore::run(&args),
    };
    failure::report(outcome)
}
