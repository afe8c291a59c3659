//! The seam between records and the format that they are written in.

use super::{LogWriter, Medium, StoreError};
use sonard_records::Record;

/// Writes the records of a log, in their order, in some format. JSON Lines is one ([`LogWriter`]);
/// another one implements this trait, and needs nothing else of whoever has the records.
pub trait RecordWriter {
    /// Writes a record, or keeps of it what the format has a place for.
    ///
    /// # Errors
    /// When it can't be written.
    fn write(&mut self, record: &Record) -> Result<(), StoreError>;

    /// Writes what is left, and puts the whole in its place. What is dropped before is not there.
    ///
    /// # Errors
    /// When it can't be written.
    fn finish(self: Box<Self>) -> Result<(), StoreError>;
}

impl<M: Medium> RecordWriter for LogWriter<M> {
    fn write(&mut self, record: &Record) -> Result<(), StoreError> {
        self.append(record)
    }

    fn finish(mut self: Box<Self>) -> Result<(), StoreError> {
        self.sync()?;
        let path = self.path().to_path_buf();
        self.medium_mut().finish().map_err(|source| StoreError::Write { path, source })
    }
}
