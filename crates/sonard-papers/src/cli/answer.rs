//! Results on standard output.

use std::io::{self, StdoutLock, Write as _};

use comfy_table::{LineStyle, TableStyle};
use serde::Serialize;

use super::{Failure, Outcome};

/// Table style with horizontal rules only.
pub(crate) const RULED: TableStyle = TableStyle::new()
    .top_border(LineStyle::none().fill('─').junction('─'))
    .header_separator(LineStyle::none().fill('─').junction('─'))
    .bottom_border(LineStyle::none().fill('─').junction('─'));

/// Prints records as JSON Lines, or formatted by `table`. A closed pipe is not an error.
pub(crate) fn print_result<T: Serialize>(
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
    match printed {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::write(&"standard output", &error))
        }
        _ => Ok(()),
    }
}
