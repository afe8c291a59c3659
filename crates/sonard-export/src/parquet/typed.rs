//! A table of typed columns that is written row by row.

use std::{io::Write, sync::Arc};

use ::parquet::{
    basic::{Compression, Encoding},
    errors::ParquetError,
    file::{
        properties::{EnabledStatistics, WriterProperties},
        writer::SerializedFileWriter,
    },
    schema::types::{Type, TypePtr},
};
use sonard_records::Session;

use super::{
    cells::{Cells, leaf, type_of},
    refused,
    remarks::Remarks,
};
use crate::{ExportError, Field, Kind, Value};

/// A table of typed columns, compressed by Snappy, that takes its rows one by one. Every cell may be null.
pub struct TypedTable<W: Write + Send> {
    out: SerializedFileWriter<W>,
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

impl<W: Write + Send> TypedTable<W> {
    /// A table that is written to `out`, from its beginning to its end; `row` is what one of its rows is.
    ///
    /// # Errors
    /// When `out` refuses the beginning.
    pub fn new(out: W, row: &str, fields: &[Field]) -> Result<Self, ExportError> {
        let schema = schema(row, fields).map_err(refused)?;
        let mut out = SerializedFileWriter::new(out, schema, Arc::new(properties(fields)))
            .map_err(refused)?;
        out.write_all(MARK)?;
        Ok(Self {
            out,
            remarks: Remarks::default(),
            waiting: fields.iter().map(Cells::of).collect(),
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

    /// The record of a session, in the metadata too.
    pub(super) fn remark_session(&mut self, number: u32, session: &Session) {
        self.remarks.add_session(number, session);
    }

    /// Adds a row, its cells in the order of the columns.
    ///
    /// # Errors
    /// When the output refuses a group of rows that this one fills.
    pub fn row<'a>(
        &mut self,
        cells: impl IntoIterator<Item = Option<Value<'a>>>,
    ) -> Result<(), ExportError> {
        for (value, cells) in cells.into_iter().zip(&mut self.waiting) {
            self.bytes += cells.push(value);
        }
        self.rows += 1;
        if self.rows >= GROUP_ROWS || self.bytes >= GROUP_BYTES {
            self.write_group().map_err(refused)?;
        }
        Ok(())
    }

    /// Writes what belongs to the end.
    ///
    /// # Errors
    /// When the output refuses it.
    pub fn finish(mut self) -> Result<(), ExportError> {
        self.write_group().map_err(refused)?;
        for remark in self.remarks.take() {
            self.out.append_key_value_metadata(remark);
        }
        self.out.finish().map_err(refused)?;
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

fn schema(row: &str, fields: &[Field]) -> Result<TypePtr, ParquetError> {
    let fields = fields.iter().map(|field| type_of(field).map(Arc::new));
    let fields = fields.collect::<Result<_, _>>()?;
    Type::group_type_builder(row).with_fields(fields).build().map(Arc::new)
}

/// How each column is written: places that repeat by dictionary, what goes on step by step as differences, what
/// was heard byte by byte apart, so that the bytes that repeat stand together.
fn properties(fields: &[Field]) -> WriterProperties {
    let by_default = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true);
    let all = fields.iter().fold(by_default, |properties, field| {
        let Some(encoding) = encoding(field) else { return properties };
        let by_dictionary = field.kind == Kind::Number && !field.is_single;
        properties
            .set_column_encoding(leaf(field), encoding)
            .set_column_dictionary_enabled(leaf(field), by_dictionary)
    });
    all.build()
}

/// How a column is written if not by dictionary.
const fn encoding(field: &Field) -> Option<Encoding> {
    match field.kind {
        Kind::Integer | Kind::Time | Kind::Integers => Some(Encoding::DELTA_BINARY_PACKED),
        Kind::Number | Kind::Numbers => Some(Encoding::BYTE_STREAM_SPLIT),
        Kind::Text | Kind::Flag => None,
    }
}
