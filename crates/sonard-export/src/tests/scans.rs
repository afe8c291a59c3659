//! Scans for the export tests.

use std::sync::Arc;

use jiff::Timestamp;
use uuid::Uuid;

use sonard_model::{
    acoustics::{Air, Sensor},
    array::RangerArray,
    model::{Options, Simulator},
    scene::{Scene, shipped},
};
use sonard_records::{Ping, PingStatus, Record, ScanPlan, ScanView, decode_line};

/// Measured scan with predictions.
const SMALL: &str = include_str!("../../../../tests/fixtures/small.jsonl");

fn records(log: &str) -> impl Iterator<Item = Record> {
    log.lines().filter_map(|line| decode_line(line.as_bytes()).ok())
}

/// Scans of a measured log with predictions.
pub(super) fn measured() -> Vec<ScanView> {
    ScanView::from_records(records(SMALL))
}

/// Records of the measured log.
pub(super) fn measured_records() -> Vec<Record> {
    records(SMALL).collect()
}

/// Scans of the measured log without session and scan start.
pub(super) fn bare() -> Vec<ScanView> {
    let kept = |record: &Record| !matches!(record, Record::Session(_) | Record::ScanStart(_));
    ScanView::from_records(records(SMALL).filter(kept))
}

/// Simulated scan of 40 beams.
pub(super) fn simulated() -> Vec<ScanView> {
    let text = shipped::text("simple-room").expect("shipped");
    let room = Arc::new(Scene::from_json(text).expect("good"));
    let pose = room.pose("fig9").expect("there");
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let simulator = Simulator::new(room, sensor, Air::default(), Options::default()).expect("good");
    let plan = ScanPlan { to_deg: 36.0, ..ScanPlan::default() };
    let scan = ScanView::simulated(&simulator, Uuid::from_u128(1), &pose, &plan, started());
    vec![scan.expect("few paths")]
}

fn started() -> Timestamp {
    "2026-11-22T12:00:00Z".parse().expect("a time")
}

/// Round of an array, with one reading of each ranger.
pub(super) fn of_array() -> Vec<ScanView> {
    let mut scan = simulated().remove(0);
    let array = RangerArray::preset("pioneer-8").expect("a preset");
    scan.pings.truncate(array.rangers.len());
    for (ping, ranger) in scan.pings.iter_mut().zip(&array.rangers) {
        ping.azimuth_deg = ranger.azimuth_deg();
        ping.ranger = Some(ranger.id.clone());
    }
    let mut session = scan.session.as_deref().expect("it has one").clone();
    session.array = Some(array);
    scan.session = Some(session.into());
    vec![scan]
}

/// Scan with a reading of each status, the echo at 1.25 m.
pub(super) fn every_status() -> ScanView {
    use PingStatus::{Echo, LinkLost, MinRange, ModuleFault, NoEcho, StepUncertain};
    let mut scan = simulated().remove(0);
    let statuses = [Echo, NoEcho, MinRange, LinkLost, StepUncertain, ModuleFault];
    let pings = statuses.iter().zip(0..).map(|(status, index)| {
        let mut ping = Ping::new(scan.scan, index, 0.9 * f64::from(index), *status);
        // The end of the blanking is not a range.
        ping.range_m = status.has_range().then_some(if *status == Echo { 1.25 } else { 0.4 });
        ping
    });
    scan.pings = pings.collect();
    if let Some(start) = &mut scan.start {
        start.plan.to_deg = 0.9 * statuses.len() as f64;
    }
    scan
}

/// Output that fails after a number of bytes.
pub(super) struct Full(pub(super) usize);

impl std::io::Write for Full {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0 = self.0.checked_sub(bytes.len()).ok_or(std::io::ErrorKind::StorageFull)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
