//! How a verb ends, and the exit code for it.

use std::{io, process::ExitCode};

use miette::Report;

use crate::scan::SinkError;

/// What a verb returns.
pub type Outcome = Result<(), Failure>;

/// Why a verb did not simply succeed.
#[derive(Debug)]
pub enum Failure {
    /// It ran and found what it was asked to look for (exit code 1). The finding is already
    /// printed, or stands in the text.
    Found(Option<String>),
    /// Wrong usage or input (exit code 2).
    Input(Report),
    /// Device, link, or a disk that gave up (exit code 3).
    Device(Report),
}

impl Failure {
    /// A usage or input failure with a message and what would be right.
    pub fn input(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self::Input(miette::miette!(help = help.to_string(), "{message}"))
    }

    /// A device or link failure with a message and what to do.
    pub fn device(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self::Device(miette::miette!(help = help.to_string(), "{message}"))
    }

    /// Somebody did not want the rest.
    pub(super) fn stopped() -> Self {
        Self::Found(Some("stopped on request".into()))
    }

    /// A failed write to standard output or a file; a reader that went away is no failure.
    ///
    /// # Errors
    /// Everything but a broken pipe.
    pub fn from_write(what: &str, error: &io::Error) -> Outcome {
        if error.kind() == io::ErrorKind::BrokenPipe {
            return Ok(());
        }
        Err(Self::device(
            format!("cannot write {what}: {error}"),
            "check free space and permissions; what was written before is kept",
        ))
    }
}

impl From<SinkError> for Failure {
    fn from(error: SinkError) -> Self {
        Self::device(&error, error.help())
    }
}

/// Prints a failure and turns it into the process's exit code.
pub(super) fn report(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Found(finding)) => {
            if let Some(finding) = finding {
                anstream::eprintln!("{finding}");
            }
            ExitCode::from(1)
        }
        Err(Failure::Input(report)) => {
            anstream::eprintln!("{report:?}");
            ExitCode::from(2)
        }
        Err(Failure::Device(report)) => {
            anstream::eprintln!("{report:?}");
            ExitCode::from(3)
        }
    }
}
