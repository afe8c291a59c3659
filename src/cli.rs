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
#[cfg(feature = "daemon")]
mod collect;
mod compare;
mod completions;
#[cfg(feature = "daemon")]
mod daemon;
mod diagnostic;
mod digest;
#[cfg(feature = "daemon")]
mod doctor;
mod export;
mod failure;
mod findings;
mod generate;
mod groups;
mod help;
mod import;
mod interpret;
#[cfg(feature = "daemon")]
mod interruptible;
mod lines;
mod locate;
mod log;
mod logs;
mod map;
mod map_file;
#[cfg(feature = "daemon")]
mod mock;
#[cfg(feature = "daemon")]
mod mock_world;
mod numbers;
#[cfg(feature = "daemon")]
mod online;
mod options;
mod output;
#[cfg(feature = "manual")]
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
#[cfg(feature = "daemon")]
mod prompt;
#[cfg(feature = "daemon")]
mod report;
#[cfg(feature = "daemon")]
mod run;
mod runtime;
#[cfg(feature = "daemon")]
mod scan;
mod scene;
mod scene_file;
mod simulate;
#[cfg(feature = "daemon")]
mod socket;
#[cfg(feature = "daemon")]
mod status;
mod suggest;
mod survey;
mod sweeps;
mod table;
mod terminal;
#[cfg(feature = "daemon")]
mod tour;
mod trace;
#[cfg(feature = "daemon")]
mod watch;
mod what_if;
mod worlds;

use build::LONG_VERSION;
pub use diagnostic::Diagnostic;
pub use failure::{Failure, Outcome};
#[cfg(feature = "daemon")]
pub use run::EmbeddedDaemon;

use std::process::ExitCode;

use clap::{Command, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::{messages, platform};

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
    #[cfg(feature = "daemon")]
    #[command(flatten)]
    Online(Box<online::Verb>),
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
    /// Reconstruct an unknown room and all poses from sweeps
    #[command(long_about = survey::ABOUT)]
    Survey(Box<survey::Args>),
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
    /// Print a script that completes the command line in a shell
    #[command(long_about = completions::ABOUT)]
    Completions(completions::Args),
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

impl Verb {
    /// Returns `true` if the verb logs its own messages, as the daemon does.
    fn logs_messages(&self) -> bool {
        #[cfg(feature = "daemon")]
        if let Self::Online(verb) = self {
            return matches!(**verb, online::Verb::Run(_));
        }
        false
    }
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
    platform::ignore_file_size_signal();
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
    if !cli.verb.logs_messages() {
        messages::warn_on_stderr();
    }
    failure::report(run_verb(cli.verb))
}

fn run_verb(verb: Verb) -> Outcome {
    match verb {
        #[cfg(feature = "daemon")]
        Verb::Online(verb) => verb.run(),
        Verb::Simulate(args) => simulate::run(&args),
        Verb::Paths(args) => paths::run(&args),
        Verb::Import(args) => import::run(&args),
        Verb::Export(args) => export::run(&args),
        Verb::Predict(args) => predict::run(&args),
        Verb::Compare(args) => compare::run(&args),
        Verb::Calibrate(args) => calibrate::run(&args),
        Verb::Locate(args) => locate::run(&args),
        Verb::Survey(args) => survey::run(&args),
        Verb::Interpret(args) => interpret::run(&args),
        Verb::Lines(args) => lines::run(&args),
        Verb::Map(args) => map::run(&args),
        Verb::Trace(args) => trace::run(&args),
        Verb::Plot(args) => plot::run(&args),
        Verb::Log(verb) => log::run(verb),
        Verb::Generate(args) => generate::run(&args),
        Verb::Completions(args) => completions::run(&args),
        Verb::Scene(verb) => scene::run(verb),
        Verb::Sensor(verb) => preset::sensor(&verb),
        Verb::Array(verb) => preset::array(&verb),
    }
}

/// Returns the arguments that name an output, each as verb and option.
#[doc(hidden)]
#[must_use]
pub fn outputs() -> Vec<String> {
    output::arguments(&Cli::command())
}

#[cfg(test)]
mod tests;
