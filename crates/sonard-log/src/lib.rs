//! Logs on disk. A crash at any moment loses at most the unsynced records, and damage is reported
//! by line number.
//!
//! [`LogWriter`] appends each record with one write. [`read_log`] returns every line of a log with
//! its record or its fault. [`check_log`] validates a whole log, and [`repair`] removes unreadable
//! lines. [`LogIndex`] finds the scans in a folder of logs.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod atomic_file;
mod check;
pub mod dataset;
mod error;
mod file_kind;
mod folder;
mod format;
pub mod grid_file;
mod history;
mod log_position;
mod open;
pub mod platform;
mod reader;
mod repair;
mod scenes;
mod sink_file;
mod sync;
mod writer;

pub use atomic_file::AtomicFile;
pub use check::{Checker, FindingKind, LogFinding, LogTotals, Severity, check_log};
pub use error::StoreError;
pub use file_kind::{FileKind, HEAD_BYTES};
pub use folder::{COLLECTED_SCANS, LogFile, LogFolder, Rotation, log_files};
pub use format::RecordWriter;
pub use history::{LogIndex, LoggedScan, ScanSpan, ScanSpanLines};
pub use log_position::{
    FINGERPRINT_BYTES, PositionFingerprint, file_digest, read_small_json, to_hex,
};
pub use open::{Recovered, is_locked, open_no_follow};
pub use reader::{Line, LineError, Lines, Loaded, load, open_for_reading, read_log};
pub use repair::{RemovedLine, Repair, repair};
pub use scenes::{MAX_LOGGED_SCENE_BYTES, SceneUnavailable, logged_scene};
pub use sink_file::{Displacement, FileOutput, LogOutput, PipeOutput};
pub use sync::{sync_file, sync_folder, sync_folder_of};
pub use writer::{LogWriter, SYNC_INTERVAL};

#[cfg(test)]
mod tests;
