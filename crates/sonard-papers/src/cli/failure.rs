//! Outcome of a command and its exit code.

use std::{fmt::Display, io, process::ExitCode};

/// Result of a command.
pub(crate) type Outcome = Result<(), Failure>;

/// Reason for an exit code other than 0.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Exit code 1: experiment completed without reaching its goal.
    Found(String),
    /// Exit code 2: wrong usage or input, and its remedy.
    Input(String, String),
    /// Exit code 3: write error, and its remedy.
    Disk(String, String),
}

impl Failure {
    /// Wrong usage or input, with its remedy.
    pub(crate) fn input(message: impl Display, help: impl Display) -> Self {
        Self::Input(message.to_string(), help.to_string())
    }

    /// Failed write. A path that can't be written to is wrong input.
    pub(crate) fn write(what: &dyn Display, error: &io::Error) -> Self {
        use io::ErrorKind as Kind;
        let message = format!("cannot write {what}: {error}");
        match error.kind() {
            Kind::NotFound
            | Kind::PermissionDenied
            | Kind::ReadOnlyFilesystem
            | Kind::IsADirectory
            | Kind::NotADirectory
            | Kind::AlreadyExists
            | Kind::InvalidFilename => {
                Self::input(message, "give a file in a folder that exists and is writable")
            }
            _ => Self::Disk(message, "check free space; earlier files are kept".into()),
        }
    }
}

/// Prints a failure and returns the exit code.
pub(crate) fn report(outcome: Outcome) -> ExitCode {
    let (code, message, help) = match outcome {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Found(finding)) => (1, finding, String::new()),
        Err(Failure::Input(message, help)) => (2, message, help),
        Err(Failure::Disk(message, help)) => (3, message, help),
    };
    eprintln!("error: {message}");
    if !help.is_empty() {
        eprintln!("help: {help}");
    }
    ExitCode::from(code)
}
