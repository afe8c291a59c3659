//! Tables of typed columns: Apache Parquet.

mod cells;
mod file_metadata;
mod typed;

use std::io::{self, Write};

use ::parquet::errors::ParquetError;

use sonard_records::ScanView;

use crate::{
    COLUMNS, Export, ExportError, ReadingRow, SkippedScan, TableColumn,
    session_numbers::SessionNumbers,
};
pub use typed::TypedTable;

/// Parquet export with one reading per row, in the typed columns of [`COLUMNS`], compressed by
/// Snappy.
///
/// Missing values are null. The file's key-value metadata contains the session records, as
/// `sonard.session.NUMBER` (JSON), and the scene texts, as `sonard.scene.SHA256`.
pub struct ParquetExport<W: Write + Send> {
    out: TypedTable<W>,
    sessions: SessionNumbers,
}

impl<W: Write + Send> ParquetExport<W> {
    /// Writes the beginning of a table to `out`.
    ///
    /// # Errors
    /// Returns the write error of the output.
    pub fn new(out: W) -> Result<Self, ExportError> {
        let fields: Vec<_> = COLUMNS.iter().map(TableColumn::column_type).collect();
        let out = TypedTable::new(out, "reading", &fields)?;
        Ok(Self { out, sessions: SessionNumbers::default() })
    }

    /// Returns `true` if `head` is the beginning of such a table.
    #[must_use]
    pub fn is_own_file(head: &[u8]) -> bool {
        TypedTable::<W>::is_own_file(head)
    }

    /// Adds an entry to the metadata of the table, such as its origin.
    pub fn add_metadata(&mut self, key: &str, value: String) {
        self.out.add_metadata(key, value);
    }
}

impl<W: Write + Send> Export for ParquetExport<W> {
    fn scan(&mut self, log: &str, scan: &ScanView) -> Result<Option<SkippedScan>, ExportError> {
        let session = self.sessions.number(scan.session.as_ref());
        if let (Some((number, true)), Some(session)) = (session, scan.session.as_deref()) {
            self.out.add_session(number, session);
        }
        for ping in &scan.pings {
            let row = ReadingRow::new(log, session.map(|(number, _)| number), scan, ping);
            self.out.row(COLUMNS.iter().map(|column| column.cell(&row)))?;
        }
        Ok(None)
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        self.out.finish()
    }
}

fn write_error(error: ParquetError) -> ExportError {
    match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => (*error).into(),
            Err(error) => io::Error::other(error).into(),
        },
        other => io::Error::other(other).into(),
    }
}
