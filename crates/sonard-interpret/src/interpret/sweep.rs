//! A scan's readings as one turn of beams, or as one round of an array's.

use std::collections::BTreeMap;

use thiserror::Error;
use uuid::Uuid;

use crate::compare::quantile;
use sonard_model::geometry::{DVec2, Pose, wrap_360};
use sonard_records::{Ping, PingStatus, ScanView};

/// Azimuths closer than this are one stop, degrees.
const SAME_STOP_DEG: f64 = 1e-6;

/// The outcome at one stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Heard {
    /// An echo, at a range in metres.
    Echo(f64),
    /// Sound that was there when the receiver opened.
    Near,
    /// Nothing.
    Silent,
}

/// One stop that was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// Azimuth, degrees in [0, 360).
    pub azimuth_deg: f64,
    /// Index of its first reading in the plan.
    pub index: u32,
    /// What was heard.
    pub heard: Heard,
    /// Where the transducer was, metres ahead and to the left of the sweep's pose: zero for one on
    /// a stepper.
    pub mount: DVec2,
}

/// The stops of one scan in order of azimuth, those without a usable reading left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// Where the ranger stood.
    pub pose: Pose,
    /// From stop to stop, degrees.
    pub step_deg: f64,
    /// The stops, in order of azimuth.
    pub beams: Vec<Beam>,
    /// Whether the last stop is a step or so before the first.
    pub closed: bool,
}

/// A scan that cannot be interpreted.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SweepError {
    /// The log does not say where the ranger stood.
    #[error("its scan_start is missing, and with it the pose")]
    NoPose,
    /// The pose is not finite.
    #[error("scan_start: pose ({x_m}, {y_m}, {heading_deg}) must be of finite numbers")]
    BadPose {
        /// World x, metres.
        x_m: f64,
        /// World y, metres.
        y_m: f64,
        /// Heading, degrees.
        heading_deg: f64,
    },
    /// A reading of a ranger that nothing is known about.
    #[error("beam {index} is of ranger {id}, which its session's array does not have")]
    UnknownRanger {
        /// The reading.
        index: u32,
        /// The ranger.
        id: String,
    },
    /// Fewer than two stops.
    #[error("it has {0} usable stop(s): angles need at least 2")]
    TooFew(usize),
}

impl Sweep {
    /// The stops of a scan.
    ///
    /// Readings lost on the line, of a doubtful step, of a module at fault, or of an echo without
    /// a finite range count as not measured. Of several readings of one beam the last counts; of
    /// several beams at one stop the majority, with the median range.
    ///
    /// Of an array, each beam has the place of its ranger, and a robot that moved meanwhile is
    /// reckoned with.
    ///
    /// # Errors
    /// When the pose is missing, a ranger is not in the session's array, or there are fewer than
    /// two usable stops.
    pub fn of(scan: &ScanView) -> Result<Self, SweepError> {
        let start = scan.start.as_ref().ok_or(SweepError::NoPose)?;
        let Pose { x_m, y_m, heading_deg } = start.pose;
        if ![x_m, y_m, heading_deg].iter().all(|part| part.is_finite()) {
            return Err(SweepError::BadPose { x_m, y_m, heading_deg });
        }
        let beams = stops(scan, &start.pose)?;
        if beams.len() < 2 {
            return Err(SweepError::TooFew(beams.len()));
        }
        let planned = start.plan.step_deg;
        let step_deg = if planned.is_finite() && planned > 0.0 && planned < 180.0 {
            planned
        } else {
            let gaps = beams.windows(2).map(|pair| pair[1].azimuth_deg - pair[0].azimuth_deg);
            quantile(gaps.collect(), 0.5).unwrap_or(360.0)
        };
        let closing_deg = beams[0].azimuth_deg + 360.0 - beams[beams.len() - 1].azimuth_deg;
        let closed = closing_deg < MOST_GAP_STEPS * step_deg && !scan.is_of_array();
        Ok(Self { pose: start.pose, step_deg, beams, closed })
    }

    /// Where a beam's transducer was, world, metres.
    #[must_use]
    pub fn place(&self, beam: &Beam) -> DVec2 {
        let turn = DVec2::from_angle(self.pose.direction_rad(0.0));
        self.pose.position() + turn.rotate(beam.mount)
    }

    /// The point at `range_m` along a beam, world, metres.
    #[must_use]
    pub fn point(&self, beam: &Beam, range_m: f64) -> DVec2 {
        let direction_rad = self.pose.direction_rad(beam.azimuth_deg);
        self.place(beam) + range_m * DVec2::from_angle(direction_rad)
    }

    /// Degrees from the stop before to this one; `None` where it is too far to be a neighbour.
    pub(super) fn gap_before_deg(&self, at: usize) -> Option<f64> {
        let here = self.beams[at].azimuth_deg;
        let gap_deg = match at.checked_sub(1) {
            Some(before) => here - self.beams[before].azimuth_deg,
            None if self.closed => here + 360.0 - self.beams[self.beams.len() - 1].azimuth_deg,
            None => return None,
        };
        (gap_deg < MOST_GAP_STEPS * self.step_deg).then_some(gap_deg)
    }
}

/// Scans from one pose as one: at each stop the majority of the repeats, with the median of their
/// ranges. Each has the place and the id of the first.
pub(super) fn merge_repeats(scans: &[(Uuid, Sweep)]) -> Vec<(Uuid, Sweep)> {
    let mut merged: Vec<(Uuid, Sweep)> = Vec::with_capacity(scans.len());
    for (at, (id, sweep)) in scans.iter().enumerate() {
        let same = |other: &Sweep| other.pose == sweep.pose && other.step_deg == sweep.step_deg;
        if scans[..at].iter().any(|(_, earlier)| same(earlier)) {
            continue;
        }
        let repeats: Vec<&Sweep> =
            scans[at..].iter().map(|(_, later)| later).filter(|later| same(later)).collect();
        let mut beams: Vec<Beam> = repeats.iter().flat_map(|sweep| sweep.beams.clone()).collect();
        if repeats.len() > 1 {
            beams.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
            beams = beams.chunk_by(same_stop).map(one_of_stop).collect();
        }
        let closed = repeats.iter().any(|sweep| sweep.closed);
        merged.push((*id, Sweep { beams, closed, ..sweep.clone() }));
    }
    merged
}

/// Neighbours may be this many steps apart: two lost readings in a row.
const MOST_GAP_STEPS: f64 = 3.5;

fn stops(scan: &ScanView, pose: &Pose) -> Result<Vec<Beam>, SweepError> {
    let has_one_place = scan.has_one_place();
    let mut by_index: BTreeMap<u32, Beam> = BTreeMap::new();
    for ping in &scan.pings {
        if let Some(beam) = beam(ping) {
            let beam = if has_one_place { beam } else { mounted(scan, ping, beam, pose)? };
            by_index.insert(ping.index, beam);
        }
    }
    let mut beams: Vec<Beam> = by_index.into_values().collect();
    beams.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
    Ok(beams.chunk_by(same_stop).map(one_of_stop).collect())
}

fn same_stop(a: &Beam, b: &Beam) -> bool {
    (b.azimuth_deg - a.azimuth_deg).abs() < SAME_STOP_DEG && a.mount == b.mount
}

/// A beam with its transducer's place and direction as seen from the scan's pose.
fn mounted(scan: &ScanView, ping: &Ping, beam: Beam, pose: &Pose) -> Result<Beam, SweepError> {
    let viewpoint = scan.viewpoint(ping).ok_or_else(|| SweepError::UnknownRanger {
        index: ping.index,
        id: ping.ranger.clone().unwrap_or_default(),
    })?;
    let turn_back = DVec2::from_angle(-pose.direction_rad(0.0));
    let mount = turn_back.rotate(viewpoint.position() - pose.position());
    let azimuth_deg = wrap_360(viewpoint.direction_deg - pose.heading_deg);
    Ok(Beam { azimuth_deg, mount, ..beam })
}

fn beam(ping: &Ping) -> Option<Beam> {
    let heard = match ping.status {
        PingStatus::Echo => Heard::Echo(ping.range_m.filter(|r| r.is_finite() && *r > 0.0)?),
        PingStatus::MinRange => Heard::Near,
        PingStatus::NoEcho => Heard::Silent,
        PingStatus::LinkLost | PingStatus::StepDoubtful | PingStatus::ModuleFault => return None,
    };
    let azimuth_deg = Some(ping.azimuth_deg).filter(|azimuth| azimuth.is_finite())?;
    let azimuth_deg = wrap_360(azimuth_deg);
    Some(Beam { azimuth_deg, index: ping.index, heard, mount: DVec2::ZERO })
}

fn one_of_stop(same: &[Beam]) -> Beam {
    let count = |of: fn(&Heard) -> bool| same.iter().filter(|beam| of(&beam.heard)).count();
    let near = count(|heard| matches!(heard, Heard::Near));
    let silent = count(|heard| matches!(heard, Heard::Silent));
    let echoes: Vec<f64> = same
        .iter()
        .filter_map(|beam| match beam.heard {
            Heard::Echo(range_m) => Some(range_m),
            _ => None,
        })
        .collect();
    let heard = if near >= silent && near > echoes.len() {
        Heard::Near
    } else if silent > echoes.len() {
        Heard::Silent
    } else {
        quantile(echoes, 0.5).map_or(Heard::Silent, Heard::Echo)
    };
    let index = same.iter().map(|beam| beam.index).min().unwrap_or_default();
    Beam { heard, index, ..same[0] }
}
