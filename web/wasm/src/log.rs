//! Scans of logs and of tables of readings.

use std::io::{self, Cursor, Read};

use jiff::Timestamp;
use serde::Serialize;
use sonard_import::{Assumptions, ImportError, ImportSource, Mapping};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
};
use sonard_records::{
    AirRecord, ModelRecord, Provenance, Record, RecordErrorKind, ScanPlan, ScanView, Session,
    decode_line,
};

use crate::RequestError;

/// Description of a scan in a file, with the settings it was recorded with.
#[derive(Debug, Serialize)]
pub(crate) struct LoggedScan<'a> {
    time: Option<Timestamp>,
    pose: Option<Pose>,
    plan: Option<ScanPlan>,
    readings: usize,
    provenance: Option<Provenance>,
    sensor: Option<&'a Sensor>,
    air: Option<AirRecord>,
    /// Engine and options of the recorded predictions.
    model: Option<&'a ModelRecord>,
    /// Text of the scene file.
    scene: Option<&'a str>,
}

impl<'a> From<&'a ScanView> for LoggedScan<'a> {
    fn from(view: &'a ScanView) -> Self {
        let start = view.start.as_ref();
        let session = view.session.as_deref();
        let air = session.map(|session| match start.and_then(|start| start.air) {
            // The scan's own measurement takes precedence over the session's.
            Some(air) => AirRecord {
                temperature_c: air.temperature_c,
                sound_speed_m_s: air.sound_speed_m_s,
                ..session.air
            },
            None => session.air,
        });
        Self {
            time: start.map(|start| start.time),
            pose: view.pose(),
            plan: start.map(|start| start.plan),
            readings: view.pings.len(),
            provenance: session.map(|session| session.provenance),
            sensor: session.map(|session| &session.sensor),
            air,
            model: session.and_then(|session| session.model.as_ref()),
            scene: session.and_then(|session| session.scene_text.as_deref()),
        }
    }
}

/// Reads the scans of a file: a log in JSON Lines, or a table that `sonard import` reads without
/// options.
pub(crate) fn scans(text: &str, pose: Pose) -> Result<Vec<ScanView>, RequestError> {
    let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let records = match decode_line(first.as_bytes()) {
        Ok(_) => decode_log(text)?,
        Err(fault) if fault.kind == RecordErrorKind::UnsupportedFormat => {
            return Err(RequestError::new(&fault.to_string(), "use a log of this version"));
        }
        Err(_) => import_table(text, pose)?,
    };
    let scans: Vec<_> =
        ScanView::from_records(records).into_iter().filter(|scan| !scan.pings.is_empty()).collect();
    if scans.is_empty() {
        let help = "open a log or a table of readings";
        return Err(RequestError::new("the file contains no readings", help));
    }
    Ok(scans)
}

/// Decodes a log. An invalid last line without line end is incomplete and therefore skipped.
fn decode_log(text: &str) -> Result<Vec<Record>, RequestError> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let mut records = Vec::new();
    for (number, line) in lines {
        match decode_line(line.as_bytes()) {
            Ok(record) => records.push(record),
            Err(_) if !text.ends_with('\n') && text.ends_with(line) => break,
            Err(error) => {
                let message = format!("line {}: {error}", number + 1);
                return Err(RequestError::new(&message, "repair the log with `sonard log repair`"));
            }
        }
    }
    Ok(records)
}

fn import_table(text: &str, pose: Pose) -> Result<Vec<Record>, RequestError> {
    let (sensor, air) = (Sensor::preset("senscomp-6500")?, Air::default());
    let taken = Assumptions {
        sha256: String::new(),
        pose,
        array: None,
        sensor: sensor.name.clone(),
        max_range_m: sensor.max_range_m,
        min_range_m: 0.0,
        air,
        started: Timestamp::UNIX_EPOCH,
        skip_checks: false,
    };
    let open =
        || -> io::Result<Box<dyn Read>> { Ok(Box::new(Cursor::new(text.as_bytes().to_vec()))) };
    let found = ImportSource { open: &open }
        .examine(Mapping::default(), taken)
        .map_err(|error| import_error(&error))?;
    let mut session = Session::new(Timestamp::UNIX_EPOCH, Provenance::Imported, sensor, &air);
    session.array.clone_from(&found.assumptions.array);
    let mut records = vec![Record::Session(Box::new(session))];
    for scan in found.scans(open()?).map_err(|error| import_error(&error))? {
        records.extend(scan.map_err(|error| import_error(&error))?);
    }
    Ok(records)
}

fn import_error(error: &ImportError) -> RequestError {
    RequestError::new(error, error.help())
}
