//! Laser scans from files.

use std::{io::BufRead, path::Path};

use super::Failure;
use crate::{interpret::lines::LaserScan, store::open_for_reading};

/// Format of a file of laser scans.
const HELP: &str = "give one JSON object per line, {\"pose\":{\"x_m\":..,\"y_m\":..,\"heading_deg\":..},\
\"returns\":[{\"azimuth_deg\":..,\"range_m\":..},..]}, azimuths rising; see `sonard lines --help`";

/// Reads a file of laser scans, `-` for standard input.
///
/// # Errors
///
/// The file can't be read, or has an invalid line, which is reported by file, line and column.
pub(super) fn load(path: &Path) -> Result<Vec<LaserScan>, Failure> {
    let shown = path.display();
    let reader = open_for_reading(path)?;
    let mut scans = Vec::new();
    for (line, number) in reader.lines().zip(1..) {
        let failure = |what: String| Failure::input(format!("{shown}:{number}: {what}"), HELP);
        let line = line.map_err(|error| failure(error.to_string()))?;
        if line.trim().is_empty() {
            continue;
        }
        let mut text = serde_json::Deserializer::from_str(&line);
        let scan: LaserScan = serde_path_to_error::deserialize(&mut text)
            .map_err(|error| failure(error.to_string()))?;
        check(&scan).map_err(failure)?;
        scans.push(scan);
    }
    Ok(scans)
}

fn check(scan: &LaserScan) -> Result<(), String> {
    let pose = &scan.pose;
    if ![pose.x_m, pose.y_m, pose.heading_deg].iter().all(|part| part.is_finite()) {
        return Err("pose: numbers must be finite".to_owned());
    }
    for (at, pair) in scan.returns.windows(2).enumerate() {
        if pair[1].azimuth_deg <= pair[0].azimuth_deg {
            let (previous, next) = (pair[0].azimuth_deg, pair[1].azimuth_deg);
            return Err(format!(
                "returns[{}].azimuth_deg: {next} follows {previous}; azimuths must increase",
                at + 1
            ));
        }
    }
    match scan.returns.iter().position(|entry| entry.range_m.is_some_and(|m| m <= 0.0)) {
        Some(at) => Err(format!("returns[{at}].range_m: must be greater than 0, or null")),
        None => Ok(()),
    }
}
