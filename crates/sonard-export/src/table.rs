//! Tables of comma-separated values.

use std::{
    fmt::{self, Display, Write as _},
    io::{self, Write},
};

use sonard_records::ScanView;

use crate::{COLUMNS, Export, ExportError, LeftOut, Row, Value, sessions::Sessions};

/// A reading a line, after a line with the names of [`COLUMNS`] (RFC 4180; lines end with a line feed).
///
/// What the log does not say is empty; times are as in the log, in UTC; lists are apart by blanks.
#[derive(Debug)]
pub struct CsvExport<W: Write> {
    out: csv::Writer<W>,
    sessions: Sessions,
    /// The text of a cell, kept for the next.
    cell: String,
}

impl<W: Write> CsvExport<W> {
    /// A table that is written to `out`.
    ///
    /// # Errors
    /// When `out` refuses the first line.
    pub fn new(out: W) -> Result<Self, ExportError> {
        let mut out = csv::Writer::from_writer(out);
        out.write_record(COLUMNS.iter().map(|column| column.name)).map_err(refused)?;
        Ok(Self { out, sessions: Sessions::default(), cell: String::new() })
    }

    /// The first line of every such table, without its end.
    #[must_use]
    pub fn head() -> String {
        let names: Vec<_> = COLUMNS.iter().map(|column| column.name).collect();
        names.join(",")
    }

    fn row(&mut self, row: &Row<'_>) -> Result<(), ExportError> {
        for column in COLUMNS {
            self.cell.clear();
            if let Some(value) = column.cell(row) {
                write_cell(&mut self.cell, &value);
            }
            self.out.write_field(&self.cell).map_err(refused)?;
        }
        self.out.write_record(None::<&[u8]>).map_err(refused)
    }
}

impl<W: Write> Export for CsvExport<W> {
    fn scan(&mut self, log: &str, scan: &ScanView) -> Result<Option<LeftOut>, ExportError> {
        let session = self.sessions.number(scan.session.as_ref()).map(|(number, _)| number);
        for ping in &scan.pings {
            self.row(&Row::new(log, session, scan, ping))?;
        }
        Ok(None)
    }

    fn finish(mut self: Box<Self>) -> Result<(), ExportError> {
        Ok(self.out.flush()?)
    }
}

fn write_cell(cell: &mut String, value: &Value<'_>) {
    // Writing to a text can't fail.
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
    for (place, number) in numbers.iter().enumerate() {
        write!(cell, "{}{number}", if place == 0 { "" } else { " " })?;
    }
    Ok(())
}

fn refused(error: csv::Error) -> ExportError {
    let told = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error.into(),
        _ => io::Error::other(told).into(),
    }
}
