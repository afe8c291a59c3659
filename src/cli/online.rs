//! Verbs of devices and of the daemon.

use clap::Subcommand;

use super::{Outcome, collect, doctor, mock, report, run, scan, status, tour, watch};

/// Verb that uses a device, a mock or a daemon.
#[derive(Debug, Subcommand)]
pub(super) enum Verb {
    /// Run the first commands of the documentation, step by step
    #[command(long_about = tour::ABOUT)]
    Tour(tour::Args),
    /// Take one or more scans and log each reading with the model's prediction
    #[command(long_about = scan::ABOUT)]
    Scan(scan::Args),
    /// Take scans by a plan, over days: poses, repeats, checks, a report
    #[command(long_about = collect::ABOUT)]
    Collect(Box<collect::Args>),
    /// Run the daemon: scan continuously, keep logs, serve the API
    #[command(long_about = run::ABOUT)]
    Run(Box<run::Args>),
    /// Show the state of running daemons
    Status(status::Args),
    /// Stream live records
    Watch(watch::Args),
    /// Run a mock ranger on a pty, with echoes from the model
    #[command(long_about = mock::ABOUT)]
    Mock(mock::Args),
    /// Diagnose a ranger: port, firmware, motor, echo
    #[command(long_about = doctor::ABOUT)]
    Doctor(doctor::Args),
    /// Collect what a bug report needs in one archive
    #[command(long_about = report::ABOUT)]
    Report(report::Args),
    /// Write manual pages and shell completions, for packages
    #[cfg(feature = "manual")]
    #[command(hide = true)]
    PackageFiles(super::package_files::Args),
    /// Drive the ranger from Raspberry Pi GPIO
    #[cfg(feature = "pi")]
    #[command(long_about = super::board::ABOUT)]
    Board(super::board::Args),
}

impl Verb {
    /// Runs the verb.
    pub(super) fn run(self) -> Outcome {
        match self {
            Self::Tour(args) => tour::run(&args),
            Self::Scan(args) => scan::run(&args),
            Self::Collect(args) => collect::run(&args),
            Self::Run(args) => run::run(*args),
            Self::Status(args) => status::run(&args),
            Self::Watch(args) => watch::run(&args),
            Self::Mock(args) => mock::run(&args),
            Self::Doctor(args) => doctor::run(&args),
            Self::Report(args) => report::run(&args),
            #[cfg(feature = "manual")]
            Self::PackageFiles(args) => super::package_files::run(&args),
            #[cfg(feature = "pi")]
            Self::Board(args) => super::board::run(&args),
        }
    }
}
