//! Tables of typed columns: Apache Parquet.

mod cells;
mod remarks;

use std::{
    io::{self, Write},
    sync::Arc,
};

use ::parquet::{
    basic::{Compression, Encoding},
    errors::ParquetError,
    file::{
        properties::{EnabledStatistics, WriterProperties},
        writer::SerializedFileWriter,
    },
    schema::types::{Type, TypePtr},
};

use sonard_records::ScanView;

use crate::{COLUMNS, Column, Export, ExportError, Kind, LeftOut, Row, sessions::Sessions};
use cells::{Cells, leaf, type_of};
use remarks::Remarks;

/// A reading a row, in the typed columns of [`COLUMNS`], compressed by Snappy.
///
/// What the log does not say is null. The records of the sessions stand in the file's key-value metadata, as
/// `sonard.session.NUMBER` (JSON), the texts of their scenes as `sonard.scene.SHA256`.
pub struct ParquetExport<W: Write + Send> {
    out: SerializedFileWriter<W>,
    sessions: Sessions,
    remarks: Remarks,
    /// The rows that wait for their group to be full, column by column.
    waiting: Vec<Cells>,
    rows: usize,
    /// What texts and lists among them take.
    bytes: usize,
}

/// Rows that are written together, each column by itself: what waits in memory, at about 400 bytes each.
const GROUP_ROWS: usize = 1 << 16;
/// The most that texts and lists of a group take.
const GROUP_BYTES: usize = 1 << 24;

/// What stands behind the four bytes that every such file begins with; readers go by places told at its end.
const MARK: &[u8] = concat!("sonard ", env!("CARGO_PKG_VERSION"), "\n").as_bytes();
const MAGIC: &[u8] = b"PAR1";

impl<W: Write + Send> ParquetExport<W> {
    /// A table that is written to `out`, from its beginning to its end.
    ///
    /// # Errors
    /// When `out` refuses the beginning.
    pub fn new(out: W) -> Result<Self, ExportError> {
        let mut out =
            SerializedFileWriter::new(out, schema().map_err(refused)?, Arc::new(properties()))
                .map_err(refused)?;
        out.write_all(MARK)?;
        Ok(Self {
            out,
            sessions: Sessions::default(),
            remarks: Remarks::default(),
            waiting: COLUMNS.iter().map(Cells::of).collect(),
            rows: 0,
            bytes: 0,
        })
    }

    /// Whether a file that begins so is such a table.
    #[must_use]
    pub fn begins(head: &[u8]) -> bool {
        head.strip_prefix(MAGIC).is_some_and(|rest| rest.starts_with(b"sonard "))
    }

    /// Says something of the whole table in its metadata, under a key of the caller's: how it was made.
    pub fn remark(&mut self, key: &str, value: String) {
        self.remarks.add(key, value);
    }

    fn row(&mut self, row: &Row<'_>) -> Result<(), ExportError> {
        for (column, cells) in COLUMNS.iter().zip(&mut self.waiting) {
            self.bytes += cells.push(column.cell(row));
        }
        self.rows += 1;
        if self.rows >= GROUP_ROWS || self.bytes >= GROUP_BYTES {
            self.write_group().map_err(refused)?;
        }
        Ok(())
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        if self.rows == 0 {
            return Ok(());
        }
        let mut group = self.out.next_row_group()?;
        for cells in &mut self.waiting {
            let Some(mut column) = group.next_column()? else { break };
            cells.write(&mut column)?;
            column.close()?;
        }
        group.close()?;
        (self.rows, self.bytes) = (0, 0);
        Ok(())
    }
}

impl<W: Write + Send> Export for ParquetExport<W> {
    fn scan(&mut self, log: &str, scan: &ScanView) -> Result<Option<LeftOut>, ExportError> {
        let session = self.sessions.number(scan.session.as_ref());
        if let (Some((number, true)), Some(session)) = (session, scan.session.as_deref()) {
            self.remarks.add_session(number, session);
        }
        for ping in &scan.pings {
            self.row(&Row::new(log, session.map(|(number, _)| number), scan, ping))?;
        }
        Ok(None)
    }

    fn finish(mut self: Box<Self>) -> Result<(), ExportError> {
        self.write_group().map_err(refused)?;
        for remark in self.remarks.take() {
            self.out.append_key_value_metadata(remark);
        }
        self.out.finish().map_err(refused)?;
        Ok(self.out.flush()?)
    }
}

fn schema() -> Result<TypePtr, ParquetError> {
    let fields = COLUMNS.iter().map(|column| type_of(column).map(Arc::new));
    let fields = fields.collect::<Result<_, _>>()?;
    Type::group_type_builder("reading").with_fields(fields).build().map(Arc::new)
}

/// How each column is written: places that repeat by dictionary, what goes on step by step as differences, what
/// was heard byte by byte apart, so that the bytes that repeat stand together.
fn properties() -> WriterProperties {
    let by_default = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true);
    let all = COLUMNS.iter().fold(by_default, |properties, column| {
        let Some(encoding) = encoding(column) else { return properties };
        let by_dictionary = column.kind == Kind::Number && !column.is_single;
        properties
            .set_column_encoding(leaf(column), encoding)
            .set_column_dictionary_enabled(leaf(column), by_dictionary)
    });
    all.build()
}

/// How a column is written if not by dictionary.
const fn encoding(column: &Column) -> Option<Encoding> {
    match column.kind {
        Kind::Integer | Kind::Time | Kind::Integers => Some(Encoding::DELTA_BINARY_PACKED),
        Kind::Number => Some(Encoding::BYTE_STREAM_SPLIT),
        Kind::Text | Kind::Flag => None,
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
