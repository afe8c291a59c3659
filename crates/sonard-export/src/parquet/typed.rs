//! Table of typed columns, written row by row.

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
    cells::{ColumnBuffer, leaf_path, parquet_type},
    file_metadata::FileMetadata,
    write_error,
};
use crate::{ColumnKind, ColumnType, ExportError, Value};

/// Parquet table of nullable, typed columns, compressed by Snappy and written row by row.
pub struct TypedTable<W: Write + Send> {
    out: SerializedFileWriter<W>,
    metadata: FileMetadata,
    /// Buffered rows of the current group, by column.
    buffers: Vec<ColumnBuffer>,
    rows: usize,
    /// Size of texts and lists in the buffers.
    bytes: usize,
}

/// Maximum number of rows per group, which are buffered at about 400 bytes each.
const GROUP_ROWS: usize = 1 << 16;
/// Maximum size of texts and lists of a group.
const GROUP_BYTES: usize = 1 << 24;

/// Mark after the magic bytes of the file; readers use offsets in the footer and ignore it.
const MARK: &[u8] = concat!("sonard ", env!("CARGO_PKG_VERSION"), "\n").as_bytes();
const MAGIC: &[u8] = b"PAR1";

impl<W: Write + Send> TypedTable<W> {
    /// Writes the beginning of a table to `out`; `row` is the name of the row type.
    ///
    /// # Errors
    /// Returns the write error of the output.
    pub fn new(out: W, row: &str, fields: &[ColumnType]) -> Result<Self, ExportError> {
        let schema = schema(row, fields).map_err(write_error)?;
        let mut out = SerializedFileWriter::new(out, schema, Arc::new(properties(fields)))
            .map_err(write_error)?;
        out.write_all(MARK)?;
        Ok(Self {
            out,
            metadata: FileMetadata::default(),
            buffers: fields.iter().map(ColumnBuffer::new).collect(),
            rows: 0,
            bytes: 0,
        })
    }

    /// Returns `true` if `head` is the beginning of such a table.
    #[must_use]
    pub fn is_own_file(head: &[u8]) -> bool {
        head.strip_prefix(MAGIC).is_some_and(|rest| rest.starts_with(b"sonard "))
    }

    /// Adds an entry to the metadata of the table, such as its origin.
    pub fn add_metadata(&mut self, key: &str, value: String) {
        self.metadata.add(key, value);
    }

    /// Adds a session record to the metadata.
    pub(super) fn add_session(&mut self, number: u32, session: &Session) {
        self.metadata.add_session(number, session);
    }

    /// Adds a row with cells in column order.
    ///
    /// # Errors
    /// Returns the write error of the row group that this row completes.
    pub fn row<'a>(
        &mut self,
        cells: impl IntoIterator<Item = Option<Value<'a>>>,
    ) -> Result<(), ExportError> {
        for (value, cells) in cells.into_iter().zip(&mut self.buffers) {
            self.bytes += cells.push(value);
        }
        self.rows += 1;
        if self.rows >= GROUP_ROWS || self.bytes >= GROUP_BYTES {
            self.write_group().map_err(write_error)?;
        }
        Ok(())
    }

    /// Writes the end of the file.
    ///
    /// # Errors
    /// Returns the write error of the output.
    pub fn finish(mut self) -> Result<(), ExportError> {
        self.write_group().map_err(write_error)?;
        for entry in self.metadata.take() {
            self.out.append_key_value_metadata(entry);
        }
        self.out.finish().map_err(write_error)?;
        Ok(())
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        if self.rows == 0 {
            return Ok(());
        }
        let mut group = self.out.next_row_group()?;
        for cells in &mut self.buffers {
            let Some(mut column) = group.next_column()? else { break };
            cells.write(&mut column)?;
            column.close()?;
        }
        group.close()?;
        (self.rows, self.bytes) = (0, 0);
        Ok(())
    }
}

fn schema(row: &str, fields: &[ColumnType]) -> Result<TypePtr, ParquetError> {
    let fields = fields.iter().map(|field| parquet_type(field).map(Arc::new));
    let fields = fields.collect::<Result<_, _>>()?;
    Type::group_type_builder(row).with_fields(fields).build().map(Arc::new)
}

/// Returns the writer properties: dictionaries for repeating positions, differences for counters,
/// and separated byte streams for measured values, so that equal bytes are adjacent.
fn properties(fields: &[ColumnType]) -> WriterProperties {
    let by_default = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true);
    let all = fields.iter().fold(by_default, |properties, field| {
        let Some(encoding) = encoding(field) else { return properties };
        let by_dictionary = field.kind == ColumnKind::Number && !field.is_single;
        properties
            .set_column_encoding(leaf_path(field), encoding)
            .set_column_dictionary_enabled(leaf_path(field), by_dictionary)
    });
    all.build()
}

/// Returns the encoding of a column without a dictionary.
const fn encoding(field: &ColumnType) -> Option<Encoding> {
    match field.kind {
        ColumnKind::Integer | ColumnKind::Time | ColumnKind::Integers => {
            Some(Encoding::DELTA_BINARY_PACKED)
        }
        ColumnKind::Number | ColumnKind::Numbers => Some(Encoding::BYTE_STREAM_SPLIT),
        ColumnKind::Text | ColumnKind::Flag => None,
    }
}
