//! Arcs: neighbouring beams of a sweep with one range.

use sonard_model::geometry::{DVec2, Pose, wrap_180, wrap_360};

use crate::{
    range_errors::RangeErrors,
    readings::{Outcome, Readings},
};

/// Maximum difference of neighbouring ranges within an arc, metres.
const SAME_M: f64 = 0.008;
/// Maximum gap between the lobes of one echo, degrees: a null of the beam pattern.
const MAX_NULL_DEG: f64 = 14.0;
/// Maximum extent of an arc of several lobes, degrees.
const MAX_EXTENT_DEG: f64 = 75.0;
/// Quantile of the ranges that is the range of the arc. Time walk delays the weak ends of an arc.
const RANGE_QUANTILE: f64 = 0.3;

/// Arc of constant range of one sweep: an echo along one path or several of nearly equal length.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Arc {
    /// Index of the sweep.
    pub(crate) sweep: usize,
    /// Position of the transducer in the frame of the pose, metres: the mean over the beams.
    pub(crate) face: DVec2,
    /// Azimuth of the middle, degrees.
    pub(crate) azimuth_deg: f64,
    /// Range, metres.
    pub(crate) range_m: f64,
    /// Bias of the middle: a nearer echo hides an end.
    pub(crate) is_cut: bool,
    /// Indices of the beams in the sweep.
    pub(crate) beams: Vec<usize>,
    /// Angle between neighbouring beams, degrees.
    pub(crate) step_deg: f64,
    /// Errors of the ranger.
    pub(crate) errors: RangeErrors,
}

impl Arc {
    /// Position of the transducer, metres.
    pub(crate) fn place(&self, pose: &Pose) -> DVec2 {
        pose.position() + self.face_of(pose)
    }

    /// Position of the transducer from that of the pose, along the axes of the world, metres.
    pub(crate) fn face_of(&self, pose: &Pose) -> DVec2 {
        pose.rotate_to_world(self.face)
    }

    /// Point at a range along the middle, metres.
    pub(crate) fn point_at(&self, pose: &Pose, range_m: f64) -> DVec2 {
        pose.point_at(self.azimuth_deg, range_m) + self.face_of(pose)
    }

    /// Standard deviation of the azimuth, degrees.
    pub(crate) fn sigma_deg(&self) -> f64 {
        let base_deg = if self.is_cut { 4.0 } else { 0.8 };
        self.errors.bearing_factor() * blurred(base_deg, self.step_deg)
    }
}

/// Standard deviation of the azimuth of an arc's middle, with that by the beams in between: each
/// end of the arc is anywhere between two beams. All in degrees.
pub(crate) fn blurred(sigma_deg: f64, step_deg: f64) -> f64 {
    sigma_deg.hypot(step_deg / 24_f64.sqrt())
}

fn mean(points: impl ExactSizeIterator<Item = DVec2>) -> DVec2 {
    let count = points.len().max(1) as f64;
    points.sum::<DVec2>() / count
}

/// Run of beams, before lobes are joined.
#[derive(Clone)]
struct Run {
    first_deg: f64,
    extent_deg: f64,
    range_m: f64,
    is_cut: [bool; 2],
    beams: Vec<usize>,
}

/// Finds the arcs of a sweep, in order of azimuth of their first beam.
///
/// A run of echoes whose neighbours differ by at most 8 mm is an arc; runs of equal range that a
/// null of the beam pattern separates are one.
pub(crate) fn find_arcs(sweep: usize, readings: &Readings, errors: RangeErrors) -> Vec<Arc> {
    let same_m = errors.same_m(SAME_M);
    let mut runs = runs(readings, same_m);
    runs.sort_by(|a, b| a.first_deg.total_cmp(&b.first_deg));
    while let Some((at, other)) = lobes(&runs, same_m) {
        let second = runs[other].clone();
        let first = &mut runs[at];
        let counts = [first.beams.len() as f64, second.beams.len() as f64];
        first.extent_deg = wrap_360(second.first_deg - first.first_deg) + second.extent_deg;
        first.range_m =
            (counts[0] * first.range_m + counts[1] * second.range_m) / (counts[0] + counts[1]);
        first.is_cut = [first.is_cut[0], second.is_cut[1]];
        first.beams.extend(second.beams);
        runs.remove(other);
    }
    let arc = |run: Run| Arc {
        sweep,
        face: mean(run.beams.iter().map(|at| readings.beams[*at].face)),
        azimuth_deg: wrap_180(run.first_deg + 0.5 * run.extent_deg),
        range_m: run.range_m,
        is_cut: run.is_cut.contains(&true),
        beams: run.beams,
        step_deg: readings.step_deg,
        errors,
    };
    runs.into_iter().map(arc).collect()
}

fn runs(readings: &Readings, same_m: f64) -> Vec<Run> {
    let count = readings.beams.len();
    let outcome = |at: usize| readings.beams[at % count].outcome;
    let is_joined = |at: usize| match (outcome(at), outcome(at + 1)) {
        (Outcome::Echo(a), Outcome::Echo(b)) => {
            (a - b).abs() < same_m && readings.gap_after_deg(at % count) < 2.0 * readings.step_deg
        }
        _ => false,
    };
    let Some(start) = (0..count).find(|&at| !is_joined((at + count - 1) % count)) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let mut done = 0;
    while done < count {
        let first = start + done;
        let mut last = first;
        while last + 1 < start + count && is_joined(last) {
            last += 1;
        }
        done += last - first + 1;
        if last - first + 1 >= readings.min_arc_beams && matches!(outcome(first), Outcome::Echo(_))
        {
            found.push(run(readings, first, last));
        }
    }
    found
}

fn run(readings: &Readings, first: usize, last: usize) -> Run {
    let count = readings.beams.len();
    let beams: Vec<usize> = (first..=last).map(|at| at % count).collect();
    let mut ranges_m: Vec<f64> = beams
        .iter()
        .filter_map(|&at| match readings.beams[at].outcome {
            Outcome::Echo(range_m) => Some(range_m),
            _ => None,
        })
        .collect();
    ranges_m.sort_by(f64::total_cmp);
    let range_m = quantile(&ranges_m, RANGE_QUANTILE);
    let is_nearer = |at: usize| match readings.beams[at % count].outcome {
        Outcome::Echo(other_m) => other_m < range_m,
        Outcome::BelowMinRange => true,
        Outcome::NoEcho => false,
    };
    let first_deg = readings.beams[first % count].azimuth_deg;
    let extent_deg = wrap_360(readings.beams[last % count].azimuth_deg - first_deg);
    let is_cut = [is_nearer(first + count - 1), is_nearer(last + 1)];
    Run { first_deg, extent_deg, range_m, is_cut, beams }
}

/// Quantile of sorted values with linear interpolation; 0 if there are none.
pub(crate) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let place = share * last as f64;
    let below = (place.floor() as usize).min(last);
    let above = (below + 1).min(last);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

/// Two runs that are lobes of one echo.
fn lobes(runs: &[Run], same_m: f64) -> Option<(usize, usize)> {
    let pairs = (0..runs.len()).flat_map(|a| (0..runs.len()).map(move |b| (a, b)));
    pairs.filter(|(a, b)| a != b).find(|&(a, b)| {
        let (first, second) = (&runs[a], &runs[b]);
        let gap_deg = wrap_360(second.first_deg - first.first_deg - first.extent_deg);
        gap_deg < MAX_NULL_DEG
            && (first.range_m - second.range_m).abs() < same_m
            && first.extent_deg + gap_deg + second.extent_deg < MAX_EXTENT_DEG
    })
}
