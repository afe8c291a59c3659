//! Scans in the formats of other tools: tables (CSV, and with the feature `parquet` Parquet) of readings beside
//! predictions, and recordings of ROS 2 (MCAP); maps, lines and features as recordings and as GeoJSON.
//!
//! [`Live`] converts records to the messages of a recording as they arrive. [`foxglove`] is the protocol of live
//! viewers, [`dds`] has topic names and encapsulation for ROS 2.
//!
//! An [`Export`] takes scans one by one and writes to any `Write`, so that its memory does not grow with the number of
//! scans.

#![warn(clippy::mod_module_files)]

mod columns;
mod conversion;
pub mod dds;
mod error;
pub mod foxglove;
mod live;
#[cfg(feature = "parquet")]
mod parquet;
mod place;
mod recording;
mod ros;
mod sessions;
mod table;

use std::io::Read;

use jiff::Timestamp;

use sonard_records::ScanView;

pub use columns::{COLUMNS, Column, Field, Kind, Row, Value};
pub use conversion::{Distribution, Profile, Settings, Topic};
pub use error::{ExportError, LeftOut};
pub use live::{Live, LiveMessage};
#[cfg(feature = "parquet")]
pub use parquet::{ParquetExport, TypedTable};
pub use place::{Findings, begins_geojson, to_geojson, write_findings};
pub use recording::McapExport;
pub use table::CsvExport;

/// Takes scans, in the order in which they were taken, and writes them in its format.
pub trait Export {
    /// Writes a scan of the log of this name; says so if the format has no place for it.
    ///
    /// # Errors
    /// What the output refuses.
    fn scan(&mut self, log: &str, scan: &ScanView) -> Result<Option<LeftOut>, ExportError>;

    /// Keeps a log itself beside what was made of it, in formats that can; others take no notice.
    ///
    /// # Errors
    /// What the output refuses, and a log that can't be read or ends before its length.
    fn attach(&mut self, log: &LogFile<'_>, bytes: &mut dyn Read) -> Result<(), ExportError> {
        let _ = (log, bytes);
        Ok(())
    }

    /// Writes what belongs to the end; the output is whole then.
    ///
    /// # Errors
    /// What the output refuses.
    fn finish(self: Box<Self>) -> Result<(), ExportError>;
}

/// A log as it is attached to what was made of it.
#[derive(Debug, Clone, Copy)]
pub struct LogFile<'a> {
    /// Its name, without folders.
    pub name: &'a str,
    /// How long it is, bytes.
    pub bytes: u64,
    /// When it was last written.
    pub written: Timestamp,
}

#[cfg(test)]
mod tests;
