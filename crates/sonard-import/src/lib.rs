//! Converts readings of ultrasonic rangers to log records.
//!
//! Supported sources are tables (CSV and similar), JSON, ROS messages as text, CARMEN and Player
//! logs and, with the feature `recordings`, ROS 2 recordings (MCAP). [`FORMATS`] lists them.
//!
//! A [`Mapping`] states the meaning of the columns. [`ImportSource`] detects the format of a file
//! and reads the file three times: for its hash and encoding, to check it against the mapping, and
//! to produce records. At most one scan is held in memory; a JSON file that is not JSON Lines is
//! held as a whole, up to 16 MB.

mod array_rounds;
mod carmen;
mod column_names;
mod encoding;
mod error;
mod examine;
mod field;
mod format;
mod infer_columns;
mod json;
mod layout;
mod limits;
mod lines;
mod mapping;
mod no_echo_constant;
mod number;
mod player;
pub mod poses;
mod reading;
#[cfg(feature = "recordings")]
mod recording;
#[cfg(not(feature = "recordings"))]
#[path = "no_recording.rs"]
mod recording;
mod ros_text;
mod scans;
mod source;
mod sweep_end;
mod table;
#[cfg(test)]
mod tests;
mod text;
mod time;
mod unit_check;

pub use error::{FileLocation, ImportError};
pub use field::{Field, FieldQuantity};
pub use format::{FORMATS, Format, FormatEntry};
pub use mapping::{Column, Decimal, Mapping, RangeUnit};
pub use reading::ImportedReading;
#[cfg(feature = "recordings")]
pub use recording::{MESSAGE_TYPES, read_message};
pub use source::{Assumptions, ImportSource, Imported, sha256_hex};

use reading::Row;
