//! Segmentation of readings into scans, and conversion of scans to records.

use jiff::Timestamp;
use sha2::{Digest as _, Sha256};
use sonard_model::{
    geometry::{Pose, wrap_360, wrap_pi},
    reading::PingStatus,
    scan_plan::ScanPlan,
};
use sonard_records::{AirSource, Ping, Record, ScanAir, ScanEnd, ScanStart};
use uuid::Uuid;

use crate::{Assumptions, ImportedReading, array_rounds::ArrayRound, sweep_end::SweepDetector};

/// Motor steps per revolution, the unit of `Ping::step`.
const STEPS_PER_REVOLUTION: f64 = 400.0;
/// Maximum number of readings per scan, as in a plan; longer scans are split.
pub(crate) const MAX_FIRINGS: usize = 65_535;
/// Tolerance of the step of an evenly spaced plan, degrees.
const EVEN_DEG: f64 = 1e-3;

/// Returns the smaller turn between two directions, degrees, positive counter-clockwise.
fn turn_deg(from_deg: f64, to_deg: f64) -> f64 {
    wrap_pi((to_deg - from_deg).to_radians()).to_degrees()
}

/// Splits a stream of readings into scans: at a new scan identifier, or else at a change of the
/// robot's pose or at the end of a sweep.
#[derive(Debug, Default)]
pub(crate) struct ScanSplitter {
    /// True if directions have no order and do not end a scan.
    is_unordered: bool,
    readings: Vec<ImportedReading>,
    sweep: SweepDetector,
    /// Scan that a full circle completed, with the sense of its rotation. The reading back at its
    /// beginning belongs to it if the next one turns round.
    circle: Option<(Vec<ImportedReading>, f64)>,
}

impl ScanSplitter {
    pub(crate) fn new(is_unordered: bool) -> Self {
        Self { is_unordered, ..Self::default() }
    }

    /// Adds the next reading and returns the scans that are complete.
    pub(crate) fn push(
        &mut self,
        reading: ImportedReading,
    ) -> impl Iterator<Item = Vec<ImportedReading>> + use<> {
        let circle = self.circle.take().map(|(mut scan, sense)| {
            let own = self.readings.last().filter(|own| is_same_scan(own, &reading));
            let turns_round = own.is_some_and(|own| {
                turn_deg(own.direction_deg, reading.direction_deg) * sense < 0.0
            });
            if turns_round {
                scan.append(&mut self.readings);
                self.sweep = SweepDetector::default();
            }
            scan
        });
        let next = self.push_to_sweep(reading);
        circle.into_iter().chain(next)
    }

    fn push_to_sweep(&mut self, reading: ImportedReading) -> Option<Vec<ImportedReading>> {
        let is_swept = !self.is_unordered && self.sweep.is_next(reading.direction_deg);
        let is_next = self.readings.last().is_some_and(|last| {
            let has_ids = reading.scan.is_some() && last.scan.is_some();
            !is_same_scan(last, &reading) || (is_swept && !has_ids)
        });
        let circle_sense = self.sweep.circle_sense().filter(|_| {
            let last = self.readings.last();
            is_swept && last.is_some_and(|last| is_same_scan(last, &reading))
        });
        if is_next || self.readings.len() == MAX_FIRINGS {
            self.sweep.restart(reading.direction_deg);
            let scan = std::mem::replace(&mut self.readings, vec![reading]);
            if let Some(sense) = circle_sense {
                self.circle = Some((scan, sense));
                return None;
            }
            return Some(scan);
        }
        self.readings.push(reading);
        None
    }

    /// Returns the last scans.
    pub(crate) fn finish(self) -> impl Iterator<Item = Vec<ImportedReading>> {
        let last = Some(self.readings).filter(|readings| !readings.is_empty());
        self.circle.map(|(scan, _)| scan).into_iter().chain(last)
    }
}

/// Returns `true` if two successive readings have equal scan identifiers, or else one pose.
pub(crate) fn is_same_scan(last: &ImportedReading, next: &ImportedReading) -> bool {
    match (&last.scan, &next.scan) {
        (Some(last), Some(next)) => last == next,
        _ => (&last.position_m, &last.heading_deg) == (&next.position_m, &next.heading_deg),
    }
}

/// Derives the identifier of a scan from file hash and number, so that repeated imports give equal
/// scans.
fn scan_id(assumptions: &Assumptions, number: u64) -> Uuid {
    let mut hash = Sha256::new();
    hash.update(assumptions.sha256.as_bytes());
    hash.update(number.to_le_bytes());
    let digest = hash.finalize();
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&digest[..16]);
    uuid::Builder::from_custom_bytes(bytes).into_uuid()
}

/// Builds the records of a scan by one rotating ranger.
pub(crate) fn records(
    assumptions: &Assumptions,
    number: u64,
    readings: &[ImportedReading],
) -> Vec<Record> {
    let scan = scan_id(assumptions, number);
    let pose = readings[0].pose(&assumptions.pose);
    let azimuth_deg = |reading: &ImportedReading| {
        let turned = if reading.is_bearing { pose.heading_deg } else { 0.0 };
        wrap_360(reading.direction_deg - turned)
    };
    let azimuths: Vec<f64> = readings.iter().map(azimuth_deg).collect();
    let (plan, indices) = plan(&azimuths);
    let pings =
        readings.iter().zip(&azimuths).zip(indices).map(|((reading, &azimuth_deg), index)| {
            let own = reading.pose(&assumptions.pose);
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
    scan_records(assumptions, scan, pose, plan, air, times, pings)
}

/// Builds the records of one round of an array.
pub(crate) fn round(assumptions: &Assumptions, number: u64, round: &ArrayRound) -> Vec<Record> {
    let scan = scan_id(assumptions, number);
    let rangers = assumptions.array.iter().flat_map(|array| &array.rangers);
    let pings = (0..).zip(rangers.zip(&round.ranges_m)).map(|(index, (ranger, range_m))| {
        let status = if range_m.is_some() { PingStatus::Echo } else { PingStatus::NoEcho };
        Ping {
            ranger: Some(ranger.id.clone()),
            time: round.time,
            tof_us: range_m.map(|range_m| 2e6 * range_m / assumptions.air.sound_speed_m_s()),
            range_m: *range_m,
            ..Ping::new(scan, index, ranger.azimuth_deg(), status)
        }
    });
    let pose = round.pose.unwrap_or(assumptions.pose);
    scan_records(
        assumptions,
        scan,
        pose,
        counting_plan(round.ranges_m.len()),
        None,
        round.time.into_iter(),
        pings,
    )
}

/// Firing of one ranger of an array.
#[cfg(feature = "recordings")]
#[derive(Debug)]
pub(crate) struct ArrayFiring<'a> {
    pub(crate) ranger: &'a str,
    pub(crate) reading: ImportedReading,
}

/// Builds the records of one round of an array whose firings have their own times and poses.
#[cfg(feature = "recordings")]
pub(crate) fn array_round_records(
    assumptions: &Assumptions,
    number: u64,
    firings: &[ArrayFiring<'_>],
) -> Vec<Record> {
    let scan = scan_id(assumptions, number);
    let pose = firings[0].reading.pose(&assumptions.pose);
    let pings = (0..).zip(firings).map(|(index, ArrayFiring { ranger, reading })| {
        let own = reading.pose(&assumptions.pose);
        Ping {
            ranger: Some((*ranger).to_owned()),
            pose: Some(own).filter(|own| *own != pose),
            time: reading.time,
            tof_us: reading.tof_us,
            range_m: reading.range_m,
            ..Ping::new(scan, index, wrap_360(reading.direction_deg), reading.status)
        }
    });
    let times = firings.iter().filter_map(|firing| firing.reading.time);
    scan_records(assumptions, scan, pose, counting_plan(firings.len()), None, times, pings)
}

fn scan_records(
    assumptions: &Assumptions,
    scan: Uuid,
    pose: Pose,
    plan: ScanPlan,
    air: Option<ScanAir>,
    times: impl Iterator<Item = Timestamp> + Clone,
    pings: impl Iterator<Item = Ping>,
) -> Vec<Record> {
    let start_time = times.clone().min().unwrap_or(assumptions.started);
    let end_time = times.max().unwrap_or(start_time);
    let start = ScanStart { air, ..ScanStart::new(scan, start_time, pose, plan) };
    let mut records = vec![Record::ScanStart(start)];
    records.extend(pings.map(|ping| Record::Ping(Box::new(ping))));
    records.push(Record::ScanEnd(ScanEnd {
        scan,
        time: end_time,
        beams: records.len() as u32 - 1,
        missing: 0,
        repaired: 0,
        duration_s: end_time.duration_since(start_time).as_secs_f64(),
        acoustic_limit_s: 0.0,
        home_drift_steps: None,
        provenance: None,
    }));
    records
}

/// Returns the plan of these azimuths, in whatever order, and the index of each azimuth in it.
/// Unevenly spaced stops get a plan that only has the right number of beams.
fn plan(azimuths: &[f64]) -> (ScanPlan, Vec<u32>) {
    let (order, sorted) = by_direction(azimuths);
    ordered_plan(azimuths)
        .or_else(|| {
            let (plan, places) = ordered_plan(&sorted)?;
            let mut indices = vec![0; places.len()];
            for (at, place) in order.into_iter().zip(places) {
                indices[at] = place;
            }
            Some((plan, indices))
        })
        .unwrap_or_else(|| (counting_plan(azimuths.len()), (0..azimuths.len() as u32).collect()))
}

/// Returns the order of azimuths counter-clockwise from the end of their greatest gap, and the
/// azimuths in that order.
pub(crate) fn by_direction(azimuths: &[f64]) -> (Vec<usize>, Vec<f64>) {
    let mut order: Vec<usize> = (0..azimuths.len()).collect();
    order.sort_by(|a, b| azimuths[*a].total_cmp(&azimuths[*b]));
    let gap_deg = |at: usize| {
        let before = order[(at + order.len() - 1) % order.len()];
        wrap_360(azimuths[order[at]] - azimuths[before])
    };
    let first = (0..order.len()).rev().max_by(|a, b| gap_deg(*a).total_cmp(&gap_deg(*b)));
    order.rotate_left(first.unwrap_or(0));
    let sorted = order.iter().map(|at| azimuths[*at]).collect();
    (order, sorted)
}

/// Returns the plan of evenly spaced azimuths in the order of their directions, and the index of
/// each azimuth in it.
fn ordered_plan(azimuths: &[f64]) -> Option<(ScanPlan, Vec<u32>)> {
    let count = azimuths.len();
    let steps = || azimuths.windows(2).map(|pair| turn_deg(pair[0], pair[1]));
    let mean = steps().sum::<f64>() / (count - 1).max(1) as f64;
    let is_even = steps().all(|step| (step - mean).abs() < EVEN_DEG);
    let span_deg = mean.abs() * count as f64;
    if !is_even || mean.abs() < EVEN_DEG || span_deg > 360.0 + EVEN_DEG {
        return None;
    }
    let from_deg = if mean > 0.0 { azimuths[0] } else { azimuths[count - 1] };
    let to_deg = from_deg + span_deg.min(360.0);
    let plan = ScanPlan { from_deg, to_deg, step_deg: mean.abs(), pings_per_stop: 1 };
    if plan.beams() != count as u32 {
        return None;
    }
    let indices = 0..count as u32;
    Some((plan, if mean > 0.0 { indices.collect() } else { indices.rev().collect() }))
}

fn counting_plan(count: usize) -> ScanPlan {
    let step_deg = 360.0 / count.max(1) as f64;
    ScanPlan { from_deg: 0.0, to_deg: 360.0, step_deg, pings_per_stop: 1 }
}
