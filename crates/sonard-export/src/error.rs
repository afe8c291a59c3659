//! What can go wrong with an export.

use std::io;

use thiserror::Error;

/// Why an export ends before its end.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The output refuses to be written.
    #[error("{0}")]
    Write(#[from] io::Error),
    /// A log that is attached can't be read to its end.
    #[error("cannot attach {name}: {source}")]
    Attach {
        /// The log.
        name: String,
        /// Why.
        source: io::Error,
    },
}

/// Why a scan has no place in a format.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LeftOut {
    /// What sensor it was is not known.
    #[error("its session is missing, and with it the sensor")]
    NoSession,
    /// Where it was taken is not known.
    #[error("its scan_start is missing, and with it the pose")]
    NoPose,
    /// Figures of sensor or air make no sense.
    #[error("its session: {0}")]
    Session(String),
    /// With this scan the live map ends.
    #[error(
        "no more map is told: {0}; `sonard map` makes one of the log, with larger cells (--resolution) or of a part \
         (--region)"
    )]
    Map(String),
}
