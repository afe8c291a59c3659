//! How a verb ends, and the exit code for it.

use std::{io, process::ExitCode};

use miette::Report;

use crate::{collect::Halt, scan::SinkError};

/// What a verb returns.
pub type Outcome = Result<(), Failure>;

/// The reason why a verb did not succeed.
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

    /// A failed write to standard output or a file; a reader that went away is no failure.
    ///
    /// # Errors
    /// Everything but a broken pipe.
    pub fn from_write(what: &str, error: &io::Error) -> Outcome {
        if error.kind() == io::ErrorKind::BrokenPipe {
            return Ok(());
        }
        Err(Self::unwritable(&what, error))
    }

    /// A place that was named and can't be written to, which is wrong input, or a disk that gave up.
    pub(super) fn unwritable(what: &dyn std::fmt::Display, error: &io::Error) -> Self {
        let message = format!("cannot write {what}: {error}");
        match is_wrong_place(error) {
            true => Self::input(
                message,
                "give a file in a folder that exists and that you may write to",
            ),
            false => Self::device(message, "check free space; what was there before is kept"),
        }
    }
}

impl From<SinkError> for Failure {
    fn from(error: SinkError) -> Self {
        Self::device(&error, error.help())
    }
}

impl From<Halt> for Failure {
    fn from(halt: Halt) -> Self {
        match halt {
            Halt::Stopped(why) => Self::Found(Some(why)),
            Halt::Wrong { message, help } => Self::input(message, help),
            Halt::Failed { message, help } => Self::device(message, help),
        }
    }
}

/// For what verbs lend to a collection.
impl From<Failure> for Halt {
    fn from(failure: Failure) -> Self {
        let help = |report: &Report| report.help().map(|help| help.to_string()).unwrap_or_default();
        match failure {
            Failure::Found(why) => Self::Stopped(why.unwrap_or_default()),
            Failure::Input(report) => Self::wrong(&report, help(&report)),
            Failure::Device(report) => Self::failed(&report, help(&report)),
        }
    }
}

/// Whether another place would do: the one that was named is not there, or not for writing.
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

/// Leaves the wrapping of failures to the terminal, so that the options which they name can be copied.
pub(super) fn print_whole_lines() {
    let whole = |_: &dyn miette::Diagnostic| -> Box<dyn miette::ReportHandler> {
        Box::new(miette::MietteHandlerOpts::new().wrap_lines(false).build())
    };
    // Only the first handler of a process counts, and this is it.
    let _ = miette::set_hook(Box::new(move |error| whole(error)));
}

/// Prints a failure and turns it into the process's exit code.
pub(super) fn report(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Found(finding)) => {
            if let Some(finding) = finding {
                notice!("{finding}");
            }
            ExitCode::from(1)
        }
        Err(Failure::Input(report)) => {
            notice!("{report:?}");
            ExitCode::from(2)
        }
        Err(Failure::Device(report)) => {
            notice!("{report:?}");
            ExitCode::from(3)
        }
    }
}
