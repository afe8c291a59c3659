//! Export of scans to the formats of other tools.
//!
//! Readings and predictions become tables (CSV and, with the feature `parquet`, Parquet) or ROS 2
//! recordings (MCAP). Maps, lines and features become recordings or GeoJSON.
//!
//! [`LiveConverter`] converts records to the messages of a recording as they arrive. [`foxglove`]
//! implements the protocol of live viewers, [`dds`] the topic names and encapsulation of ROS 2.
//!
//! An [`Export`] takes scans one by one and writes to any `Write`, so its memory does not grow with
//! their number.

#![warn(clippy::mod_module_files)]

mod columns;
mod conversion;
pub mod dds;
mod error;
mod findings;
pub mod foxglove;
mod live;
#[cfg(feature = "parquet")]
mod parquet;
mod recording;
mod ros;
mod session_numbers;
mod table;

use std::io::Read;

use jiff::Timestamp;

use sonard_records::ScanView;

pub use columns::{COLUMNS, ColumnKind, ColumnType, ReadingRow, TableColumn, Value};
pub use conversion::{Distribution, ExportSettings, Profile, Topic};
pub use error::{ExportError, SkippedScan};
pub use findings::{PlaceFindings, is_geojson, to_geojson, write_findings};
pub use live::{LiveConverter, LiveMessage};
#[cfg(feature = "parquet")]
pub use parquet::{ParquetExport, TypedTable};
pub use recording::McapExport;
pub use table::CsvExport;

/// Writer of scans in one format, in the order in which they were recorded.
pub trait Export {
    /// Writes a scan of the log `log`; returns the reason if the format cannot represent the scan.
    ///
    /// # Errors
    /// Returns the write error of the output.
    fn scan(&mut self, log: &str, scan: &ScanView) -> Result<Option<SkippedScan>, ExportError>;

    /// Attaches the log itself, in formats that support attachments; other formats ignore it.
    ///
    /// # Errors
    /// Returns the write error of the output, or an error if the log is unreadable or shorter than
    /// stated.
    fn attach(&mut self, log: &AttachedLog<'_>, bytes: &mut dyn Read) -> Result<(), ExportError> {
        let _ = (log, bytes);
        Ok(())
    }

    /// Writes the end of the file, which completes the output.
    ///
    /// # Errors
    /// Returns the write error of the output.
    fn finish(self: Box<Self>) -> Result<(), ExportError>;
}

/// Log to attach to an export.
#[derive(Debug, Clone, Copy)]
pub struct AttachedLog<'a> {
    /// File name without folders.
    pub name: &'a str,
    /// Length of the log.
    pub bytes: u64,
    /// Time of the last modification.
    pub modified: Timestamp,
}

#[cfg(test)]
mod tests;
