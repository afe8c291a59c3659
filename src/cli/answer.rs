//! Results of a verb on standard output.

use std::io::{self, StdoutLock, Write as _};

use serde::Serialize;

use super::{Failure, Outcome};

/// Prints records as JSON, one per line, or as text written by `table`.
pub(super) fn print_result<T: Serialize>(
    json: bool,
    records: impl IntoIterator<Item = T>,
    table: impl FnOnce(&mut StdoutLock<'_>) -> io::Result<()>,
) -> Outcome {
    let mut out = io::stdout().lock();
    let printed = if json {
        records.into_iter().try_for_each(|record| {
            serde_json::to_writer(&mut out, &record)?;
            writeln!(out)
        })
    } else {
        table(&mut out)
    };
    printed.or_else(|error| Failure::from_write("standard output", &error))
}
