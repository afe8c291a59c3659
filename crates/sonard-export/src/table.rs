//! Tables of comma-separated values.

use std::{
    fmt::{self, Display, Write as _},
    io::{self, Write},
};

use sonard_records::ScanView;

use crate::{
    COLUMNS, Export, ExportError, ReadingRow, SkippedScan, Value, session_numbers::SessionNumbers,
};

/// CSV export with one reading per line, after a header with the names of [`COLUMNS`] (RFC 4180,
/// line feeds).
///
/// Missing values are empty, times are in UTC as in the log, and lists are separated by blanks.
#[derive(Debug)]
pub struct CsvExport<W: Write> {
    out: csv::Writer<W>,
    sessions: SessionNumbers,
    /// Buffer of a cell, reused.
    cell: String,
}

impl<W: Write> CsvExport<W> {
    /// Writes the header of a table to `out`.
    ///
    /// # Errors
    /// Returns the write error of the header.
    pub fn new(out: W) -> Result<Self, ExportError> {
        let mut out = csv::Writer::from_writer(out);
        out.write_record(COLUMNS.iter().map(|column| column.name)).map_err(write_error)?;
        Ok(Self { out, sessions: SessionNumbers::default(), cell: String::new() })
    }

    /// Returns the header line of such a table, without the line end.
    #[must_use]
    pub fn head() -> String {
        let names: Vec<_> = COLUMNS.iter().map(|column| column.name).collect();
        names.join(",")
    }

    fn row(&mut self, row: &ReadingRow<'_>) -> Result<(), ExportError> {
        for column in COLUMNS {
            self.cell.clear();
            if let Some(value) = column.cell(row) {
                write_cell(&mut self.cell, &value);
            }
            self.out.write_field(&self.cell).map_err(write_error)?;
        }
        self.out.write_record(None::<&[u8]>).map_err(write_error)
    }
}

impl<W: Write> Export for CsvExport<W> {
    fn scan(&mut self, log: &str, scan: &ScanView) -> Result<Option<SkippedScan>, ExportError> {
        let session = self.sessions.number(scan.session.as_ref()).map(|(number, _)| number);
        for ping in &scan.pings {
            self.row(&ReadingRow::new(log, session, scan, ping))?;
        }
        Ok(None)
    }

    fn finish(mut self: Box<Self>) -> Result<(), ExportError> {
        Ok(self.out.flush()?)
    }
}

fn write_cell(cell: &mut String, value: &Value<'_>) {
    // Writing to a string cannot fail.
    let _ = match value {
        Value::Text(text) => cell.write_str(text),
        Value::Integer(number) => write!(cell, "{number}"),
        Value::Number(number) => write!(cell, "{number}"),
        Value::Flag(flag) => write!(cell, "{flag}"),
        Value::Time(time) => write!(cell, "{time}"),
        Value::Integers(numbers) => write_list(cell, numbers),
        Value::Numbers(numbers) => write_list(cell, numbers),
    };
}

fn write_list(cell: &mut String, numbers: &[impl Display]) -> fmt::Result {
    for (index, number) in numbers.iter().enumerate() {
        write!(cell, "{}{number}", if index == 0 { "" } else { " " })?;
    }
    Ok(())
}

fn write_error(error: csv::Error) -> ExportError {
    let message = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error.into(),
        _ => io::Error::other(message).into(),
    }
}
