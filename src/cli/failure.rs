//! Outcome of a verb, and its exit code.

use std::{io, process::ExitCode};

use super::Diagnostic;
use crate::scan::SinkError;

/// Result of a verb.
pub type Outcome = Result<(), Failure>;

/// Reason why a verb failed.
#[derive(Debug)]
pub enum Failure {
    /// Negative result (exit code 1), already printed or given as text.
    Found(Option<String>),
    /// Wrong usage or input (exit code 2).
    Input(Diagnostic),
    /// Error of device, link or disk (exit code 3).
    Device(Diagnostic),
}

impl Failure {
    /// Creates a usage or input failure with a message and advice.
    pub fn input(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self::Input(Diagnostic::new(message, help))
    }

    /// Creates a device or link failure with a message and advice.
    pub fn device(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self::Device(Diagnostic::new(message, help))
    }

    /// Converts a failed write to standard output or a file; a closed reader is not a failure.
    ///
    /// # Errors
    ///
    /// All errors except a broken pipe.
    pub fn from_write(what: &str, error: &io::Error) -> Outcome {
        if error.kind() == io::ErrorKind::BrokenPipe {
            return Ok(());
        }
        Err(Self::unwritable(&what, error))
    }

    /// Creates the failure of a path that can't be written: wrong input for an unsuitable path,
    /// otherwise a disk error.
    pub(super) fn unwritable(what: &dyn std::fmt::Display, error: &io::Error) -> Self {
        let message = format!("cannot write {what}: {error}");
        match is_wrong_place(error) {
            true => Self::input(
                message,
                "give a file in a folder that exists and that you may write to",
            ),
            false => Self::device(message, "check free space; the previous file is unchanged"),
        }
    }
}

impl From<SinkError> for Failure {
    fn from(error: SinkError) -> Self {
        Self::device(&error, error.help())
    }
}

/// Returns `true` if the path itself is unsuitable: missing or not writable.
pub(super) fn is_wrong_place(error: &io::Error) -> bool {
    use io::ErrorKind as Kind;
    matches!(
        error.kind(),
        Kind::NotFound
            | Kind::PermissionDenied
            | Kind::ReadOnlyFilesystem
            | Kind::IsADirectory
            | Kind::NotADirectory
            | Kind::AlreadyExists
            | Kind::InvalidFilename
            | Kind::InvalidInput
    )
}

/// Prints a failure and converts the outcome to an exit code.
pub(super) fn report(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Found(finding)) => {
            if let Some(finding) = finding {
                notice!("{finding}");
            }
            ExitCode::from(1)
        }
        Err(Failure::Input(diagnostic)) => {
            notice!("{}", diagnostic.render());
            ExitCode::from(2)
        }
        Err(Failure::Device(diagnostic)) => {
            notice!("{}", diagnostic.render());
            ExitCode::from(3)
        }
    }
}
