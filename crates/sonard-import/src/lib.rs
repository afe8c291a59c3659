//! Readings of ultrasonic rangers from elsewhere, as records of a log: from tables (CSV and its kin), from
//! numbers in JSON, from the logs of CARMEN and Player, and, with the feature `recordings`, from recordings of ROS 2 (MCAP).
//!
//! A [`Mapping`] says what the columns mean; [`Source`] finds out how a file is written, reads it once for
//! its hash, once to find what speaks against the mapping and once to make records, and holds no
//! more of it than a scan (of JSON that is no object a line, all).

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

pub use error::{ImportError, Place};
pub use field::{Field, Quantity};
pub use mapping::{Column, Format, Mapping};
pub use reading::Reading;
#[cfg(feature = "recordings")]
pub use recording::{MESSAGE_TYPES, read_message};
pub use source::{Imported, Source, Taken, digest};

use reading::Row;
