//! Readings of a scan ordered by azimuth, for a stepper or an array.

use std::collections::BTreeMap;

use thiserror::Error;
use uuid::Uuid;

use crate::compare::quantile;
use sonard_model::geometry::{DVec2, Pose, wrap_360};
use sonard_records::{Ping, PingStatus, ScanView};

/// Maximum azimuth difference of readings at one stop, degrees.
const SAME_STOP_DEG: f64 = 1e-6;

/// Outcome of the measurement at one stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BeamOutcome {
    /// Echo at a range in metres.
    Echo(f64),
    /// Target below the minimum range: sound arrived before the end of blanking.
    BelowMinRange,
    /// No echo within the maximum range.
    NoEcho,
}

/// Stop with a valid reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweepBeam {
    /// Azimuth, degrees in [0, 360).
    pub azimuth_deg: f64,
    /// Index in the plan of the first reading at the stop.
    pub index: u32,
    /// Outcome of the measurement.
    pub outcome: BeamOutcome,
    /// Transducer position, metres ahead and to the left of the sweep's pose: zero for one on a
    /// stepper.
    pub mount: DVec2,
}

/// Stops of one scan in order of azimuth, without those that lack a valid reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// Pose of the ranger or robot.
    pub pose: Pose,
    /// Angle between neighbouring stops, degrees.
    pub step_deg: f64,
    /// Stops, in order of azimuth.
    pub beams: Vec<SweepBeam>,
    /// Whether the first stop follows the last one around the full turn.
    pub closed: bool,
}

/// Scan that cannot be interpreted.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SweepError {
    /// Missing start record, and thus missing pose.
    #[error("its scan_start is missing, and with it the pose")]
    NoPose,
    /// Pose that is not finite.
    #[error("scan_start: pose ({x_m}, {y_m}, {heading_deg}) must consist of finite numbers")]
    BadPose {
        /// World x, metres.
        x_m: f64,
        /// World y, metres.
        y_m: f64,
        /// Heading, degrees.
        heading_deg: f64,
    },
    /// Reading of a ranger that is not in the session's array.
    #[error("beam {index} belongs to ranger {id}, which is not in the array of the session")]
    UnknownRanger {
        /// Index of the reading.
        index: u32,
        /// Id of the ranger.
        id: String,
    },
    /// Fewer than two stops.
    #[error("it has {0} usable stop(s): angles need at least 2")]
    TooFew(usize),
}

impl Sweep {
    /// Collects the stops of a scan.
    ///
    /// Readings that are lost, of an uncertain step, of a faulty module, or echoes without a finite
    /// range count as not measured. Of several readings of one beam the last one is used; of
    /// several beams at one stop the majority, with the median range.
    ///
    /// For an array, each beam has the position of its ranger, including the motion of the robot
    /// during the scan.
    ///
    /// # Errors
    /// The pose is missing or not finite, a ranger is not in the session's array, or there are
    /// fewer than two usable stops.
    pub fn from_scan(scan: &ScanView) -> Result<Self, SweepError> {
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
        let closed = closing_deg < MAX_GAP_STEPS * step_deg && !scan.is_array_scan();
        Ok(Self { pose: start.pose, step_deg, beams, closed })
    }

    /// World position of a beam's transducer, metres.
    #[must_use]
    pub fn place(&self, beam: &SweepBeam) -> DVec2 {
        let turn = DVec2::from_angle(self.pose.direction_rad(0.0));
        self.pose.position() + turn.rotate(beam.mount)
    }

    /// World position of the point at `range_m` along a beam, metres.
    #[must_use]
    pub fn point(&self, beam: &SweepBeam, range_m: f64) -> DVec2 {
        let direction_rad = self.pose.direction_rad(beam.azimuth_deg);
        self.place(beam) + range_m * DVec2::from_angle(direction_rad)
    }

    /// Angle from the preceding stop, degrees; `None` if that is too far to be a neighbour.
    pub(super) fn gap_before_deg(&self, at: usize) -> Option<f64> {
        let here = self.beams[at].azimuth_deg;
        let gap_deg = match at.checked_sub(1) {
            Some(before) => here - self.beams[before].azimuth_deg,
            None if self.closed => here + 360.0 - self.beams[self.beams.len() - 1].azimuth_deg,
            None => return None,
        };
        (gap_deg < MAX_GAP_STEPS * self.step_deg).then_some(gap_deg)
    }
}

/// Merges scans from one pose: at each stop the majority of the repeats, with the median of their
/// ranges. The result has the position and id of the first.
pub(super) fn merge_repeats(scans: &[(Uuid, Sweep)]) -> Vec<(Uuid, Sweep)> {
    let mut merged: Vec<(Uuid, Sweep)> = Vec::with_capacity(scans.len());
    for (at, (id, sweep)) in scans.iter().enumerate() {
        let same = |other: &Sweep| other.pose == sweep.pose && other.step_deg == sweep.step_deg;
        if scans[..at].iter().any(|(_, earlier)| same(earlier)) {
            continue;
        }
        let repeats: Vec<&Sweep> =
            scans[at..].iter().map(|(_, later)| later).filter(|later| same(later)).collect();
        let mut beams: Vec<SweepBeam> =
            repeats.iter().flat_map(|sweep| sweep.beams.clone()).collect();
        if repeats.len() > 1 {
            beams.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
            beams = beams.chunk_by(same_stop).map(merge_stop).collect();
        }
        let closed = repeats.iter().any(|sweep| sweep.closed);
        merged.push((*id, Sweep { beams, closed, ..sweep.clone() }));
    }
    merged
}

/// Maximum gap between neighbours, steps: two lost readings in a row.
const MAX_GAP_STEPS: f64 = 3.5;

fn stops(scan: &ScanView, pose: &Pose) -> Result<Vec<SweepBeam>, SweepError> {
    let has_one_place = scan.is_from_one_position();
    let mut by_index: BTreeMap<u32, SweepBeam> = BTreeMap::new();
    for ping in &scan.pings {
        if let Some(beam) = beam(ping) {
            let beam = if has_one_place { beam } else { mounted(scan, ping, beam, pose)? };
            by_index.insert(ping.index, beam);
        }
    }
    let mut beams: Vec<SweepBeam> = by_index.into_values().collect();
    beams.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
    Ok(beams.chunk_by(same_stop).map(merge_stop).collect())
}

fn same_stop(a: &SweepBeam, b: &SweepBeam) -> bool {
    (b.azimuth_deg - a.azimuth_deg).abs() < SAME_STOP_DEG && a.mount == b.mount
}

/// Beam with the position and direction of its transducer relative to the scan's pose.
fn mounted(
    scan: &ScanView,
    ping: &Ping,
    beam: SweepBeam,
    pose: &Pose,
) -> Result<SweepBeam, SweepError> {
    let viewpoint = scan.viewpoint(ping).ok_or_else(|| SweepError::UnknownRanger {
        index: ping.index,
        id: ping.ranger.clone().unwrap_or_default(),
    })?;
    let turn_back = DVec2::from_angle(-pose.direction_rad(0.0));
    let mount = turn_back.rotate(viewpoint.position() - pose.position());
    let azimuth_deg = wrap_360(viewpoint.direction_deg - pose.heading_deg);
    Ok(SweepBeam { azimuth_deg, mount, ..beam })
}

fn beam(ping: &Ping) -> Option<SweepBeam> {
    let outcome = match ping.status {
        PingStatus::Echo => BeamOutcome::Echo(ping.range_m.filter(|r| r.is_finite() && *r > 0.0)?),
        PingStatus::MinRange => BeamOutcome::BelowMinRange,
        PingStatus::NoEcho => BeamOutcome::NoEcho,
        PingStatus::LinkLost | PingStatus::StepUncertain | PingStatus::ModuleFault => return None,
    };
    let azimuth_deg = Some(ping.azimuth_deg).filter(|azimuth| azimuth.is_finite())?;
    let azimuth_deg = wrap_360(azimuth_deg);
    Some(SweepBeam { azimuth_deg, index: ping.index, outcome, mount: DVec2::ZERO })
}

fn merge_stop(same: &[SweepBeam]) -> SweepBeam {
    let count = |matches: fn(&BeamOutcome) -> bool| {
        same.iter().filter(|beam| matches(&beam.outcome)).count()
    };
    let near = count(|outcome| matches!(outcome, BeamOutcome::BelowMinRange));
    let no_echo = count(|outcome| matches!(outcome, BeamOutcome::NoEcho));
    let echoes: Vec<f64> = same
        .iter()
        .filter_map(|beam| match beam.outcome {
            BeamOutcome::Echo(range_m) => Some(range_m),
            _ => None,
        })
        .collect();
    let outcome = if near >= no_echo && near > echoes.len() {
        BeamOutcome::BelowMinRange
    } else if no_echo > echoes.len() {
        BeamOutcome::NoEcho
    } else {
        quantile(echoes, 0.5).map_or(BeamOutcome::NoEcho, BeamOutcome::Echo)
    };
    let index = same.iter().map(|beam| beam.index).min().unwrap_or_default();
    SweepBeam { outcome, index, ..same[0] }
}
