//! Command line: one module per verb.

/// Writes a line for people to standard error. A closed standard error is ignored, and a reader
/// that stalls delays the program for a second at most.
macro_rules! notice {
    ($($argument:tt)*) => {
        $crate::cli::terminal::write_notice(&format!($($argument)*))
    };
}

/// Writes a line to standard output; a closed reader is ignored.
macro_rules! print_line {
    ($($argument:tt)*) => {
        $crate::cli::terminal::print_line(&format!($($argument)*))
    };
}

mod answer;
mod array;
#[cfg(feature = "pi")]
mod board;
mod build;
mod calibrate;
mod collect;
mod compare;
mod completions;
mod daemon;
mod doctor;
mod export;
mod failure;
mod findings;
mod generate;
mod groups;
mod help;
mod import;
mod interpret;
mod lines;
mod locate;
mod log;
mod logs;
mod map;
mod map_file;
mod mock;
mod mock_world;
mod numbers;
mod options;
mod output;
mod package_files;
mod paths;
mod picture;
mod place;
mod plot;
mod predict;
mod predictor;
mod preset;
mod prior;
mod progress;
mod report;
mod run;
mod runtime;
mod scan;
mod scene;
mod scene_file;
mod simulate;
mod socket;
mod status;
mod suggest;
mod sweeps;
mod table;
mod terminal;
mod tour;
mod trace;
mod watch;
mod what_if;
mod worlds;

use build::LONG_VERSION;
pub use failure::{Failure, Outcome};
pub use run::EmbeddedDaemon;

use std::{process::ExitCode, sync::Arc};

use clap::{Command, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::messages;

/// Drive an ultrasonic ranger on a stepper, and predict its readings
#[derive(Debug, Parser)]
#[command(version, long_version = LONG_VERSION, about)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

/// Exit codes of the verbs whose help lists none of their own.
const EXIT_CODES: &str = "Exit codes: 0 done, 1 ran and found a failure, 2 wrong usage or input (including \
an output that can't be written), 3 device, link or disk error.";

#[derive(Debug, Subcommand)]
enum Verb {
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
    /// Drive the ranger from Raspberry Pi GPIO
    #[cfg(feature = "pi")]
    #[command(long_about = board::ABOUT)]
    Board(board::Args),
    /// Diagnose a ranger: port, firmware, motor, echo
    #[command(long_about = doctor::ABOUT)]
    Doctor(doctor::Args),
    /// Predict a scan with the model alone
    #[command(long_about = simulate::ABOUT)]
    Simulate(simulate::Args),
    /// List the propagation paths of echoes at a position
    #[command(long_about = paths::ABOUT)]
    Paths(paths::Args),
    /// Show the echo trace of one ping, each peak with its propagation path
    #[command(long_about = trace::ABOUT)]
    Trace(trace::Args),
    /// Generate random training data
    #[command(long_about = generate::ABOUT)]
    Generate(generate::Args),
    /// Convert readings to a log: tables, JSON, recordings of ROS 2, logs of CARMEN and Player
    #[command(long_about = import::ABOUT)]
    Import(Box<import::Args>),
    /// Write logs for other tools: recordings of ROS 2, tables
    #[command(long_about = export::ABOUT)]
    Export(export::Args),
    /// Add the model's predictions to a log
    #[command(long_about = predict::ABOUT)]
    Predict(Box<predict::Args>),
    /// Compare a log's readings with its predictions
    Compare(compare::Args),
    /// Fit sensor, air, scene and poses to measurements
    #[command(long_about = calibrate::ABOUT)]
    Calibrate(Box<calibrate::Args>),
    /// Find the poses of scans without an initial guess
    #[command(long_about = locate::ABOUT)]
    Locate(Box<locate::Args>),
    /// Classify planes, corners and edges in scans
    #[command(long_about = interpret::ABOUT)]
    Interpret(interpret::Args),
    /// Make a map of line segments from the scans of logs
    #[command(long_about = lines::ABOUT)]
    Lines(lines::Args),
    /// Make an occupancy grid from the scans of logs
    #[command(long_about = map::ABOUT)]
    Map(map::Args),
    /// Draw scans: floor plan, polar, residuals
    #[command(long_about = plot::ABOUT)]
    Plot(plot::Args),
    /// Check, repair or show a log
    #[command(subcommand)]
    Log(log::Verb),
    /// Collect what a bug report needs in one archive
    #[command(long_about = report::ABOUT)]
    Report(report::Args),
    /// Print a script that completes the command line in a shell
    #[command(long_about = completions::ABOUT)]
    Completions(completions::Args),
    /// Write manual pages and shell completions, for packages
    #[command(hide = true)]
    PackageFiles(package_files::Args),
    /// Check, draw or make a scene file (from a map or drawing), list or print the shipped ones
    #[command(subcommand)]
    Scene(scene::Verb),
    /// List or print the shipped sensors
    #[command(subcommand)]
    Sensor(preset::SensorVerb),
    /// List or print the shipped arrays of rangers
    #[command(subcommand)]
    Array(preset::ArrayVerb),
}

/// Builds the command line for help texts as wide as the terminal.
fn command_line() -> Command {
    command_line_within(help::columns())
}

/// Builds the command line for help texts of the given width (0 is unlimited): verbs in groups,
/// exit codes with every verb, completions, and values that may be negative numbers, so that a
/// minus followed by a digit never starts an option.
fn command_line_within(columns: usize) -> Command {
    fn finish(command: Command, columns: usize) -> Command {
        let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
        let help = match (help.contains("Exit codes:"), help.is_empty()) {
            (true, _) => help,
            (false, true) => EXIT_CODES.to_owned(),
            (false, false) => format!("{help}\n\n{EXIT_CODES}"),
        };
        command
            .after_help(help::break_examples(&help, columns))
            .mut_args(|arg| match arg.get_action().takes_values() {
                true => arg.allow_negative_numbers(true),
                false => arg,
            })
            .mut_subcommands(|command| finish(command, columns))
    }
    let command = completions::with_values(finish(Cli::command(), columns));
    groups::in_groups(command.term_width(columns))
}

/// Runs the command line of this process.
#[must_use]
pub fn main() -> ExitCode {
    completions::serve_requests();
    build::declare();
    ignore_file_size_signal();
    failure::print_whole_lines();
    let mut command = command_line();
    let arguments: Vec<_> = std::env::args_os().collect();
    let matches = command.try_get_matches_from_mut(&arguments).unwrap_or_else(|error| {
        let arguments = arguments.iter().skip(1).map(AsRef::as_ref);
        help::print_and_exit(&suggest::suggest(error, &command, arguments))
    });
    if let Err(failure) = output::register_inputs(&command, &matches) {
        return failure::report(Err(failure));
    }
    let cli =
        Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit());
    // The daemon logs its own messages.
    if !matches!(cli.verb, Verb::Run(_)) {
        messages::warn_on_stderr();
    }
    let outcome = match cli.verb {
        Verb::Scan(args) => scan::run(&args),
        Verb::Collect(args) => collect::run(&args),
        Verb::Run(args) => run::run(*args),
        Verb::Status(args) => status::run(&args),
        Verb::Watch(args) => watch::run(&args),
        Verb::Mock(args) => mock::run(&args),
        #[cfg(feature = "pi")]
        Verb::Board(args) => board::run(&args),
        Verb::Doctor(args) => doctor::run(&args),
        Verb::Simulate(args) => simulate::run(&args),
        Verb::Paths(args) => paths::run(&args),
        Verb::Import(args) => import::run(&args),
        Verb::Export(args) => export::run(&args),
        Verb::Predict(args) => predict::run(&args),
        Verb::Compare(args) => compare::run(&args),
        Verb::Calibrate(args) => calibrate::run(&args),
        Verb::Locate(args) => locate::run(&args),
        Verb::Interpret(args) => interpret::run(&args),
        Verb::Lines(args) => lines::run(&args),
        Verb::Map(args) => map::run(&args),
        Verb::Trace(args) => trace::run(&args),
        Verb::Plot(args) => plot::run(&args),
        Verb::Log(verb) => log::run(verb),
        Verb::Generate(args) => generate::run(&args),
        Verb::Tour(args) => tour::run(&args),
        Verb::Report(args) => report::run(&args),
        Verb::Completions(args) => completions::run(&args),
        Verb::PackageFiles(args) => package_files::run(&args),
        Verb::Scene(verb) => scene::run(verb),
        Verb::Sensor(verb) => preset::sensor(&verb),
        Verb::Array(verb) => preset::array(&verb),
    };
    failure::report(outcome)
}

/// Returns the arguments that name an output, each as verb and option.
#[doc(hidden)]
#[must_use]
pub fn outputs() -> Vec<String> {
    output::arguments(&Cli::command())
}

/// Makes an exceeded file-size limit an error of the write, with a message, instead of the end of
/// the process.
fn ignore_file_size_signal() {
    // If no handler can be installed, the system's default applies.
    drop(signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default()));
}

#[cfg(test)]
mod tests;
