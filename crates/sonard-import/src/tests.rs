//! End-to-end tests of the importer, by kind of file.

mod headers;
mod messages;
mod no_echo;
mod order;
mod ros_text;
mod tables;
mod texts;
mod units;

use std::io::{self, Cursor, Read};

use jiff::Timestamp;
use sonard_model::{acoustics::Air, geometry::Pose};
use sonard_records::{Ping, Record, ScanStart};

use crate::{Assumptions, ImportError, ImportSource, Imported, Mapping};

/// Assumptions for a file without further information.
fn assumptions() -> Assumptions {
    Assumptions {
        sha256: String::new(),
        pose: Pose { x_m: 1.0, y_m: 2.0, heading_deg: 30.0 },
        array: None,
        sensor: "hc-sr04".to_owned(),
        max_range_m: 4.0,
        min_range_m: 0.02,
        air: Air::default(),
        started: Timestamp::UNIX_EPOCH,
        skip_checks: false,
    }
}

fn examine(
    text: &[u8],
    mapping: Mapping,
    assumptions: Assumptions,
) -> Result<Imported, ImportError> {
    let open = || -> io::Result<Box<dyn Read>> { Ok(Box::new(Cursor::new(text.to_vec()))) };
    ImportSource { open: &open }.examine(mapping, assumptions)
}

/// Imports a file and returns all records.
fn import(text: &str, mapping: Mapping) -> Result<Vec<Record>, ImportError> {
    let found = examine(text.as_bytes(), mapping, assumptions())?;
    let scans: Result<Vec<_>, _> = found.scans(text.as_bytes())?.collect();
    Ok(scans?.into_iter().flatten().collect())
}

fn columns(text: &str) -> Mapping {
    Mapping { columns: Mapping::parse_columns(text).expect("columns"), ..Mapping::default() }
}

fn pings(records: &[Record]) -> Vec<Ping> {
    let ping = |record: &Record| match record {
        Record::Ping(ping) => Some(Ping::clone(ping)),
        _ => None,
    };
    records.iter().filter_map(ping).collect()
}

fn starts(records: &[Record]) -> Vec<ScanStart> {
    let start = |record: &Record| match record {
        Record::ScanStart(start) => Some(start.clone()),
        _ => None,
    };
    records.iter().filter_map(start).collect()
}

/// Returns message and advice of an error.
fn error_text<T: std::fmt::Debug>(result: Result<T, ImportError>) -> String {
    let error = result.expect_err("this is wrong");
    format!("{error}; {}", error.help())
}
