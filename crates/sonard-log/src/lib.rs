//! Logs on disk: written so that a crash at any moment costs at most what was not yet synced,
//! and read so that damage is named by its line.
//!
//! [`LogWriter`] appends one record with one write. [`read_log`] gives every line of a log with
//! its record or with what is wrong. [`check`] looks at a whole log, [`repair`] leaves out what
//! can't be read. [`History`] finds the scans in a folder of logs.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod check;
pub mod dataset;
mod error;
mod folder;
mod format;
pub mod grid_file;
mod history;
mod kind;
mod mark;
mod medium;
mod open;
mod reader;
mod repair;
mod scenes;
mod sync;
mod whole;
mod writer;

pub use check::{Checker, Finding, FindingKind, Severity, Totals, check};
pub use error::StoreError;
pub use folder::{LogFile, LogFolder, Rotation, log_files};
pub use format::RecordWriter;
pub use history::{History, Passage, PassageLines, PastScan};
pub use kind::{FileKind, HEAD_BYTES};
pub use mark::{MARK_BYTES, Mark, digest_of, hexadecimal, read_small};
pub use medium::{Displacement, FileMedium, Medium, Pipe};
pub use open::{Recovered, is_being_written, open_own};
pub use reader::{Line, LineError, Lines, Loaded, load, open_for_reading, read_log};
pub use repair::{LeftOut, Repair, repair};
pub use scenes::{MAX_LOGGED_SCENE_BYTES, SceneLost, logged_scene};
pub use sync::{sync_file, sync_folder, sync_folder_of};
pub use whole::WholeFile;
pub use writer::{LogWriter, SYNC_INTERVAL};

#[cfg(test)]
mod tests;
