//! Converts readings of ultrasonic rangers to records of a log: from tables (CSV and similar), JSON, messages of ROS as
//! text, the logs of CARMEN and Player, and, with the feature `recordings`, recordings of ROS 2 (MCAP). [`FORMATS`] lists
//! them.
//!
//! A [`Mapping`] states the meaning of the columns. [`Source`] detects the format of a file, reads it once for its hash and
//! encoding, once to check it against the mapping and once to make records, and holds at most one scan in memory (a JSON
//! file that is not JSON Lines is held as a whole, up to 64 MB).

mod carmen;
mod doubt;
mod encoding;
mod error;
mod examine;
mod field;
mod format;
mod guess;
mod json;
mod layout;
mod limits;
mod lines;
mod mapping;
mod number;
mod player;
mod reading;
#[cfg(feature = "recordings")]
mod recording;
#[cfg(not(feature = "recordings"))]
#[path = "no_recording.rs"]
mod recording;
mod ros_text;
mod rounds;
mod scans;
mod silence;
mod source;
mod table;
#[cfg(test)]
mod tests;
mod text;
mod time;
mod turning;
mod words;

pub use error::{ImportError, Location};
pub use field::{Field, Quantity};
pub use format::{FORMATS, Format, FormatEntry};
pub use mapping::{Column, Decimal, Mapping, RangeUnit};
pub use reading::Reading;
#[cfg(feature = "recordings")]
pub use recording::{MESSAGE_TYPES, read_message};
pub use source::{Imported, Source, Taken, digest};

use reading::Row;
