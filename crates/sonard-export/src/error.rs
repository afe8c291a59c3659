//! Export errors, and reasons for skipping a scan.

use std::io;

use thiserror::Error;

/// Error that ends an export.
#[derive(Debug, Error)]
pub enum ExportError {
    /// Write error of the output.
    #[error("{0}")]
    Write(#[from] io::Error),
    /// Log that could not be read to its end.
    #[error("cannot attach {name}: {source}")]
    Attach {
        /// File name of the log.
        name: String,
        /// Read error of the log.
        source: io::Error,
    },
}

/// Reason why a format cannot represent a scan.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SkippedScan {
    /// Missing session record, so the sensor is unknown.
    #[error("session record missing: sensor unknown")]
    NoSession,
    /// Missing `scan_start` record, so the pose is unknown.
    #[error("scan_start record missing: pose unknown")]
    NoPose,
    /// Session record with invalid parameters of sensor or air.
    #[error("invalid session record: {0}")]
    Session(String),
    /// Live map that ends with this scan.
    #[error(
        "live map stopped: {0}; create the map from the log with `sonard map`, with larger cells (--resolution) or for \
                   a part (--region)"
    )]
    Map(String),
}
