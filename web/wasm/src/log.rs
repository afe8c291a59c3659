//! Logs and tables of readings, read for their scans.

use std::io::{self, Cursor, Read};

use jiff::Timestamp;
use serde::Serialize;
use sonard_import::{Mapping, Source, Taken};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
};
use sonard_records::{
    AirRecord, FaultKind, ModelRecord, Provenance, Record, ScanPlan, ScanView, Session, decode_line,
};

use crate::Refusal;

/// A scan of a file, with what is to be known to show it as it was taken.
#[derive(Debug, Serialize)]
pub(crate) struct Found<'a> {
    time: Option<Timestamp>,
    pose: Option<Pose>,
    plan: Option<ScanPlan>,
    readings: usize,
    provenance: Option<Provenance>,
    /// Its sensor's data.
    sensor: Option<&'a Sensor>,
    air: Option<AirRecord>,
    /// Its model and settings.
    model: Option<&'a ModelRecord>,
    /// Text of its scene's file.
    scene: Option<&'a str>,
}

impl<'a> Found<'a> {
    pub(crate) fn of(view: &'a ScanView) -> Self {
        let start = view.start.as_ref();
        let session = view.session.as_deref();
        let air = session.map(|session| match start.and_then(|start| start.air) {
            // What was known when the scan began.
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

/// The scans of a file: JSON Lines of this program, or what `sonard import` reads without being told more.
pub(crate) fn scans(text: &str, pose: Pose) -> Result<Vec<ScanView>, Refusal> {
    let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let records = match decode_line(first.as_bytes()) {
        Ok(_) => own(text)?,
        Err(fault) if fault.kind == FaultKind::UnsupportedFormat => {
            return Err(Refusal::new(&fault.to_string(), "drop a log of this version"));
        }
        Err(_) => foreign(text, pose)?,
    };
    let scans: Vec<_> =
        ScanView::from_records(records).into_iter().filter(|scan| !scan.pings.is_empty()).collect();
    if scans.is_empty() {
        return Err(Refusal::new("there is no reading in it", "drop a log or a table of readings"));
    }
    Ok(scans)
}

/// A last line without an end is one that was being written.
fn own(text: &str) -> Result<Vec<Record>, Refusal> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let mut records = Vec::new();
    for (number, line) in lines {
        match decode_line(line.as_bytes()) {
            Ok(record) => records.push(record),
            Err(_) if !text.ends_with('\n') && text.ends_with(line) => break,
            Err(error) => {
                let message = format!("line {}: {error}", number + 1);
                return Err(Refusal::new(&message, "`sonard log repair` keeps what is whole"));
            }
        }
    }
    Ok(records)
}

fn foreign(text: &str, pose: Pose) -> Result<Vec<Record>, Refusal> {
    let (sensor, air) = (Sensor::preset("senscomp-6500")?, Air::default());
    let taken = Taken {
        sha256: String::new(),
        pose,
        array: None,
        sensor: sensor.name.clone(),
        longest_m: sensor.max_range_m,
        least_m: 0.0,
        air,
        started: Timestamp::UNIX_EPOCH,
        as_said: false,
    };
    let open =
        || -> io::Result<Box<dyn Read>> { Ok(Box::new(Cursor::new(text.as_bytes().to_vec()))) };
    let found = Source { open: &open }.examine(Mapping::default(), taken)?;
    let mut session = Session::new(Timestamp::UNIX_EPOCH, Provenance::Imported, sensor, &air);
    session.array.clone_from(&found.taken.array);
    let mut records = vec![Record::Session(Box::new(session))];
    for scan in found.scans(open()?)? {
        records.extend(scan?);
    }
    Ok(records)
}
