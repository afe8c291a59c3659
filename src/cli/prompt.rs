//! Prompts to the operator.

use std::io::{self, BufRead as _, IsTerminal as _, Write as _};

use super::Failure;

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
