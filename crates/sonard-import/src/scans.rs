//! Readings gathered into scans, and scans as records.

use jiff::Timestamp;
use sha2::{Digest as _, Sha256};
use sonard_model::{
    geometry::{Pose, wrap_360, wrap_pi},
    plan::ScanPlan,
    reading::PingStatus,
};
use sonard_records::{AirSource, Ping, Record, ScanAir, ScanEnd, ScanStart};
use uuid::Uuid;

use crate::{Reading, Taken, rounds::Round, turning::Turning};

/// Motor steps a revolution that `step` counts in.
const STEPS_PER_REVOLUTION: f64 = 400.0;
/// A scan with more firings than a plan can have is cut.
pub(crate) const MOST_FIRINGS: usize = 65_535;
/// Stops this evenly apart are a plan's, degrees.
const EVEN_DEG: f64 = 1e-3;

/// The smaller turn from one direction to another, degrees, positive counter-clockwise.
fn turn_deg(from_deg: f64, to_deg: f64) -> f64 {
    wrap_pi((to_deg - from_deg).to_radians()).to_degrees()
}

/// Cuts a stream of readings into scans: where the file names another scan, else where the robot stands elsewhere, else
/// where a sweep ends.
#[derive(Debug, Default)]
pub(crate) struct Cutter {
    readings: Vec<Reading>,
    turning: Turning,
}

impl Cutter {
    /// Takes the next reading; the scan before it, if that ended.
    pub(crate) fn push(&mut self, reading: Reading) -> Option<Vec<Reading>> {
        let is_swept = self.turning.is_next(reading.direction_deg);
        let is_next = self.readings.last().is_some_and(|last| {
            let moved =
                (&reading.place_m, &reading.heading_deg) != (&last.place_m, &last.heading_deg);
            match (&reading.scan, &last.scan) {
                (Some(this), Some(before)) => this != before,
                _ => moved || is_swept,
            }
        });
        if is_next || self.readings.len() == MOST_FIRINGS {
            self.turning.restart(reading.direction_deg);
            return Some(std::mem::replace(&mut self.readings, vec![reading]));
        }
        self.readings.push(reading);
        None
    }

    /// The last scan.
    pub(crate) fn finish(self) -> Option<Vec<Reading>> {
        Some(self.readings).filter(|readings| !readings.is_empty())
    }
}

/// Identifies the scan of a file by the file and its number, so that a file imported twice makes the same scans.
fn id(taken: &Taken, number: u64) -> Uuid {
    let mut hash = Sha256::new();
    hash.update(taken.sha256.as_bytes());
    hash.update(number.to_le_bytes());
    let digest = hash.finalize();
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&digest[..16]);
    uuid::Builder::from_custom_bytes(bytes).into_uuid()
}

/// The records of a scan of one ranger that turns.
pub(crate) fn records(taken: &Taken, number: u64, readings: &[Reading]) -> Vec<Record> {
    let scan = id(taken, number);
    let pose = readings[0].pose(&taken.pose);
    let azimuth_deg = |reading: &Reading| {
        let turned = if reading.is_bearing { pose.heading_deg } else { 0.0 };
        wrap_360(reading.direction_deg - turned)
    };
    let azimuths: Vec<f64> = readings.iter().map(azimuth_deg).collect();
    let (plan, indices) = plan(&azimuths);
    let pings =
        readings.iter().zip(&azimuths).zip(indices).map(|((reading, &azimuth_deg), index)| {
            let own = reading.pose(&taken.pose);
            Ping {
                step: (azimuth_deg / 360.0 * STEPS_PER_REVOLUTION).round() as i32,
                pose: Some(own).filter(|own| *own != pose),
                time: reading.time,
                tof_us: reading.tof_us,
                range_m: reading.range_m,
                ..Ping::new(scan, index, azimuth_deg, reading.status)
            }
        });
    let air = readings.iter().find_map(|reading| reading.air).map(|air| ScanAir {
        temperature_c: air.temperature_c(),
        sound_speed_m_s: air.sound_speed_m_s(),
        source: AirSource::File,
        age_s: None,
    });
    let times = readings.iter().filter_map(|reading| reading.time);
    whole(taken, scan, pose, plan, air, times, pings)
}

/// The records of a round of an array's rangers.
pub(crate) fn round(taken: &Taken, number: u64, round: &Round) -> Vec<Record> {
    let scan = id(taken, number);
    let rangers = taken.array.iter().flat_map(|array| &array.rangers);
    let pings = (0..).zip(rangers.zip(&round.ranges_m)).map(|(index, (ranger, range_m))| {
        let status = if range_m.is_some() { PingStatus::Echo } else { PingStatus::NoEcho };
        Ping {
            ranger: Some(ranger.id.clone()),
            time: round.time,
            tof_us: range_m.map(|range_m| 2e6 * range_m / taken.air.sound_speed_m_s()),
            range_m: *range_m,
            ..Ping::new(scan, index, ranger.azimuth_deg(), status)
        }
    });
    let pose = round.pose.unwrap_or(taken.pose);
    whole(taken, scan, pose, firings(round.ranges_m.len()), None, round.time.into_iter(), pings)
}

/// A firing of one of an array's rangers.
#[cfg(feature = "recordings")]
#[derive(Debug)]
pub(crate) struct Firing<'a> {
    pub(crate) ranger: &'a str,
    pub(crate) reading: Reading,
}

/// The records of a round of an array's rangers, each fired at a time and place of its own.
#[cfg(feature = "recordings")]
pub(crate) fn firings_of_array(taken: &Taken, number: u64, fired: &[Firing<'_>]) -> Vec<Record> {
    let scan = id(taken, number);
    let pose = fired[0].reading.pose(&taken.pose);
    let pings = (0..).zip(fired).map(|(index, Firing { ranger, reading })| {
        let own = reading.pose(&taken.pose);
        Ping {
            ranger: Some((*ranger).to_owned()),
            pose: Some(own).filter(|own| *own != pose),
            time: reading.time,
            tof_us: reading.tof_us,
            range_m: reading.range_m,
            ..Ping::new(scan, index, wrap_360(reading.direction_deg), reading.status)
        }
    });
    let times = fired.iter().filter_map(|firing| firing.reading.time);
    whole(taken, scan, pose, firings(fired.len()), None, times, pings)
}

fn whole(
    taken: &Taken,
    scan: Uuid,
    pose: Pose,
    plan: ScanPlan,
    air: Option<ScanAir>,
    times: impl Iterator<Item = Timestamp> + Clone,
    pings: impl Iterator<Item = Ping>,
) -> Vec<Record> {
    let began = times.clone().min().unwrap_or(taken.started);
    let ended = times.max().unwrap_or(began);
    let start = ScanStart { air, ..ScanStart::new(scan, began, pose, plan) };
    let mut records = vec![Record::ScanStart(start)];
    records.extend(pings.map(|ping| Record::Ping(Box::new(ping))));
    records.push(Record::ScanEnd(ScanEnd {
        scan,
        time: ended,
        beams: records.len() as u32 - 1,
        missing: 0,
        repaired: 0,
        duration_s: ended.duration_since(began).as_secs_f64(),
        acoustic_limit_s: 0.0,
        home_drift_steps: None,
        provenance: None,
    }));
    records
}

/// The plan of these azimuths, and the place of each in it. Of stops that are not evenly apart it has as many
/// beams as there are readings, and nothing more.
fn plan(azimuths: &[f64]) -> (ScanPlan, Vec<u32>) {
    let count = azimuths.len();
    let steps = || azimuths.windows(2).map(|pair| turn_deg(pair[0], pair[1]));
    let mean = steps().sum::<f64>() / (count - 1).max(1) as f64;
    let even = steps().all(|step| (step - mean).abs() < EVEN_DEG);
    let span_deg = mean.abs() * count as f64;
    if !even || mean.abs() < EVEN_DEG || span_deg > 360.0 + EVEN_DEG {
        return (firings(count), (0..count as u32).collect());
    }
    let from_deg = if mean > 0.0 { azimuths[0] } else { azimuths[count - 1] };
    let to_deg = from_deg + span_deg.min(360.0);
    let plan = ScanPlan { from_deg, to_deg, step_deg: mean.abs(), pings_per_stop: 1 };
    if plan.beams() != count as u32 {
        return (firings(count), (0..count as u32).collect());
    }
    let indices = 0..count as u32;
    (plan, if mean > 0.0 { indices.collect() } else { indices.rev().collect() })
}

fn firings(count: usize) -> ScanPlan {
    let step_deg = 360.0 / count.max(1) as f64;
    ScanPlan { from_deg: 0.0, to_deg: 360.0, step_deg, pings_per_stop: 1 }
}
