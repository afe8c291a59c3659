//! Interface of output formats for records.

use super::{LogOutput, LogWriter, StoreError};
use sonard_records::Record;

/// Writer of a log's records in one output format. [`LogWriter`] implements JSON Lines; other
/// formats implement this trait independently of the source of the records.
pub trait RecordWriter {
    /// Writes a record, or the part of it that the format can represent.
    ///
    /// # Errors
    /// Returns an error if the record cannot be written.
    fn write(&mut self, record: &Record) -> Result<(), StoreError>;

    /// Writes the remaining data and moves the output to its path. A writer that is dropped earlier
    /// leaves no output.
    ///
    /// # Errors
    /// Returns an error if the output cannot be written.
    fn finish(self: Box<Self>) -> Result<(), StoreError>;
}

impl<M: LogOutput> RecordWriter for LogWriter<M> {
    fn write(&mut self, record: &Record) -> Result<(), StoreError> {
        self.append(record)
    }

    fn finish(mut self: Box<Self>) -> Result<(), StoreError> {
        self.sync()?;
        let path = self.path().to_path_buf();
        self.output_mut().finish().map_err(|source| StoreError::Write { path, source })
    }
}
