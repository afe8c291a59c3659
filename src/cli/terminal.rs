//! Lines on standard output and standard error, and prompts.

use std::{
    io::{self, BufRead as _, IsTerminal as _, Write as _},
    os::fd::AsFd,
};

use anstream::{AutoStream, ColorChoice, adapter::strip_str};

use super::Failure;
use crate::messages::write_stderr;

/// Writes a line to standard error, without colours if they are not supported.
pub(super) fn write_notice(line: &str) {
    match AutoStream::choice(&io::stderr()) {
        ColorChoice::Never => write_stderr(&format!("{}\n", strip_str(line))),
        _ => write_stderr(&format!("{line}\n")),
    }
}

/// Writes a line to standard output. Verbs whose result is on standard output use
/// [`Failure::from_write`](super::Failure::from_write) instead.
pub(super) fn print_line(line: &str) {
    // A closed reader is ignored.
    drop(writeln!(anstream::stdout(), "{line}"));
}

/// Returns `true` if an operator can answer a [`prompt`].
pub(super) fn is_interactive() -> bool {
    io::stdin().is_terminal() && io::stdout().is_terminal()
}

/// Prints a prompt and reads the answer; `None` at the end of the input.
///
/// # Errors
///
/// A failed read or write, with the advice to give `--yes`.
pub(super) fn prompt(question: &str) -> Result<Option<String>, Failure> {
    let mut out = io::stdout();
    let mut line = String::new();
    write!(out, "{question} ")
        .and_then(|()| out.flush())
        .and_then(|()| io::stdin().lock().read_line(&mut line))
        .map_err(|error| Failure::device(format!("cannot prompt: {error}"), "give --yes"))?;
    Ok(line.ends_with('\n').then(|| line.trim().to_owned()))
}

/// Width of the terminal on standard output, columns; `None` without one.
pub(super) fn stdout_columns() -> Option<u16> {
    column_count(io::stdout())
}

/// Width of a terminal, columns; `None` for other files, and for terminals of unknown width.
pub(super) fn column_count(stream: impl AsFd) -> Option<u16> {
    let size = rustix::termios::tcgetwinsize(stream).ok()?;
    Some(size.ws_col).filter(|columns| *columns > 0)
}
