//! Running of other programs.

use std::process::{Command, Stdio};

use crate::Failure;

/// Runs a program, whose output is shown.
///
/// # Errors
/// A program that can't be started or fails.
pub(crate) fn run(command: &mut Command) -> Result<(), Failure> {
    let status = command.status().map_err(|error| describe(command, &error))?;
    if status.success() { Ok(()) } else { Err(describe(command, &status)) }
}

/// Runs a program and returns its standard output, without the last line end.
///
/// # Errors
/// A program that can't be started or fails.
pub(crate) fn read(command: &mut Command) -> Result<String, Failure> {
    let output = command.stderr(Stdio::inherit()).output();
    let output = output.map_err(|error| describe(command, &error))?;
    if !output.status.success() {
        return Err(describe(command, &output.status));
    }
    Ok(String::from_utf8(output.stdout)?.trim_end().to_owned())
}

/// Runs a program and returns its standard error output.
///
/// # Errors
/// A program that can't be started or fails.
pub(crate) fn read_errors(command: &mut Command) -> Result<String, Failure> {
    let output = command.output().map_err(|error| describe(command, &error))?;
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    if !output.status.success() {
        return Err(format!("{}: {printed}", describe(command, &output.status)).into());
    }
    Ok(printed)
}

fn describe(command: &Command, reason: &dyn std::fmt::Display) -> Failure {
    let program = command.get_program().to_string_lossy();
    let arguments: Vec<_> = command.get_args().map(|part| part.to_string_lossy()).collect();
    format!("{program} {}: {reason}", arguments.join(" ")).into()
}
