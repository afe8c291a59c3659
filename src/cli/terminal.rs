//! Lines on standard output and standard error, and the width of the terminal.

use std::io::{self, Write as _};

use anstream::{AutoStream, ColorChoice, adapter::strip_str};
use terminal_size::{Width, terminal_size, terminal_size_of};

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

/// Width of the terminal on standard output, columns; `None` without one.
pub(super) fn stdout_columns() -> Option<u16> {
    terminal_size_of(io::stdout()).and_then(columns)
}

/// Width of the terminal on standard output, standard error or standard input, columns; `None`
/// without one.
pub(super) fn any_columns() -> Option<u16> {
    terminal_size().and_then(columns)
}

/// Width, unless the terminal does not report it.
fn columns<H>((Width(columns), _): (Width, H)) -> Option<u16> {
    Some(columns).filter(|columns| *columns > 0)
}
