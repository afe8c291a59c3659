//! What a verb found, on standard output.

use std::io::{self, StdoutLock, Write as _};

use serde::Serialize;

use super::{Failure, Outcome};

/// Prints records as JSON, one a line, or as `table` shows them.
pub(super) fn answer<T: Serialize>(
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
