//! Converts readings of ultrasonic rangers to records of a log: from tables (CSV and similar), JSON, the logs of CARMEN
//! and Player, and, with the feature `recordings`, recordings of ROS 2 (MCAP).
//!
//! A [`Mapping`] states the meaning of the columns. [`Source`] detects the format of a file, reads it once for its hash,
//! once to check it against the mapping and once to make records, and holds at most one scan in memory (a JSON file that is
//! not JSON Lines is held as a whole).

mod carmen;
mod doubt;
mod error;
mod field;
mod guess;
mod json;
mod mapping;
mod player;
mod reading;
#[cfg(feature = "recordings")]
mod recording;
#[cfg(not(feature = "recordings"))]
#[path = "no_recording.rs"]
mod recording;
mod rounds;
mod scans;
mod source;
mod table;
#[cfg(test)]
mod tests;

pub use error::{ImportError, Location};
pub use field::{Field, Quantity};
pub use mapping::{Column, Format, Mapping};
pub use reading::Reading;
#[cfg(feature = "recordings")]
pub use recording::{MESSAGE_TYPES, read_message};
pub use source::{Imported, Source, Taken, digest};

use reading::Row;
