//! Tables of typed columns: Apache Parquet.

mod cells;
mod remarks;
mod typed;

use std::io::{self, Write};

use ::parquet::errors::ParquetError;

use sonard_records::ScanView;

use crate::{COLUMNS, Column, Export, ExportError, LeftOut, Row, sessions::Sessions};
pub use typed::TypedTable;

/// A reading a row, in the typed columns of [`COLUMNS`], compressed by Snappy.
///
/// What the log does not say is null. The records of the sessions stand in the file's key-value metadata, as
/// `sonard.session.NUMBER` (JSON), the texts of their scenes as `sonard.scene.SHA256`.
pub struct ParquetExport<W: Write + Send> {
    out: TypedTable<W>,
    sessions: Sessions,
}

impl<W: Write + Send> ParquetExport<W> {
    /// A table that is written to `out`, from its beginning to its end.
    ///
    /// # Errors
    /// When `out` refuses the beginning.
    pub fn new(out: W) -> Result<Self, ExportError> {
        let fields: Vec<_> = COLUMNS.iter().map(Column::field).collect();
        let out = TypedTable::new(out, "reading", &fields)?;
        Ok(Self { out, sessions: Sessions::default() })
    }

    /// Whether a file that begins so is such a table.
    #[must_use]
    pub fn begins(head: &[u8]) -> bool {
        TypedTable::<W>::begins(head)
    }

    /// Says something of the whole table in its metadata, under a key of the caller's: how it was made.
    pub fn remark(&mut self, key: &str, value: String) {
        self.out.remark(key, value);
    }
}

impl<W: Write + Send> Export for ParquetExport<W> {
    fn scan(&mut self, log: &str, scan: &ScanView) -> Result<Option<LeftOut>, ExportError> {
        let session = self.sessions.number(scan.session.as_ref());
        if let (Some((number, true)), Some(session)) = (session, scan.session.as_deref()) {
            self.out.remark_session(number, session);
        }
        for ping in &scan.pings {
            let row = Row::new(log, session.map(|(number, _)| number), scan, ping);
            self.out.row(COLUMNS.iter().map(|column| column.cell(&row)))?;
        }
        Ok(None)
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        self.out.finish()
    }
}

fn refused(error: ParquetError) -> ExportError {
    match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => (*error).into(),
            Err(error) => io::Error::other(error).into(),
        },
        other => io::Error::other(other).into(),
    }
}
