//! Segmentation of scans into regions of constant depth.

use super::{BeamOutcome, InterpretSettings, Sweep};
use crate::compare::quantile;
use sonard_model::geometry::wrap_360;

/// Boundary of a region on one side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegionBorder {
    /// Boundary of the element's own arc, next to no echo or something farther.
    Own,
    /// Boundary by something nearer, whose echo arrived first.
    Covered,
    /// Boundary by the end of the scan, or of its valid readings.
    Cut,
}

/// Neighbouring beams of equal range.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Indices in the plan of the first and last beam, counter-clockwise.
    pub beams: [u32; 2],
    /// Azimuths of the first and last beam, degrees; the last may be 360 or more.
    pub azimuths_deg: [f64; 2],
    /// Angles from the preceding beam to the first, and from the last to the following, degrees.
    pub gaps_deg: [f64; 2],
    /// Boundaries on both sides.
    pub sides: [RegionBorder; 2],
    /// Median range, metres; `None` for a target below the minimum range.
    pub range_m: Option<f64>,
    /// Number of beams.
    pub count: usize,
}

impl Region {
    /// Azimuth of the middle, the estimate of `theta_N`, degrees in [0, 360) (10), (11).
    #[must_use]
    pub fn bearing_deg(&self) -> f64 {
        let [start, end] = self.borders_deg();
        wrap_360((start + end) / 2.0)
    }

    /// Estimated angular extent, degrees (13).
    #[must_use]
    pub fn extent_deg(&self) -> f64 {
        let [start, end] = self.borders_deg();
        end - start
    }

    /// Returns `true` if both boundaries are the element's own.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.sides == [RegionBorder::Own; 2]
    }

    /// Middles of the gaps in which the region begins and ends (11).
    fn borders_deg(&self) -> [f64; 2] {
        let ([first, last], [before, after]) = (self.azimuths_deg, self.gaps_deg);
        [first - before / 2.0, last + after / 2.0]
    }
}

/// Finds the regions of constant depth of a scan, in order of azimuth.
///
/// A beam belongs to a region if its range is within the settings' tolerance of the region's
/// mean; a few outliers inside are bridged. Beams without echo form no region.
#[must_use]
pub fn regions(sweep: &Sweep, settings: &InterpretSettings) -> Vec<Region> {
    let finder = Finder { sweep, tolerance_m: settings.depth_tolerance_m };
    let count = sweep.beams.len();
    let start = (0..count).find(|&at| finder.begins(at)).unwrap_or(0);
    let mut found = Vec::new();
    let mut done = 0;
    while done < count {
        let first = start + done;
        let last = finder.last_of(first, count - done, settings.max_holes);
        if !matches!(finder.outcome_at(first), BeamOutcome::NoEcho) {
            found.push(finder.region(first, last));
        }
        done += last - first + 1;
    }
    found.sort_by(|a, b| a.azimuths_deg[0].total_cmp(&b.azimuths_deg[0]));
    found
}

/// Access to the beams of a sweep, with indices that wrap past the end of a closed one.
struct Finder<'a> {
    sweep: &'a Sweep,
    tolerance_m: f64,
}

impl Finder<'_> {
    fn outcome_at(&self, at: usize) -> BeamOutcome {
        self.sweep.beams[at % self.sweep.beams.len()].outcome
    }

    fn gap_before_deg(&self, at: usize) -> Option<f64> {
        self.sweep.gap_before_deg(at % self.sweep.beams.len())
    }

    /// Returns `true` if the beam does not continue the region of the preceding one.
    fn begins(&self, at: usize) -> bool {
        let before = self.outcome_at(at + self.sweep.beams.len() - 1);
        self.gap_before_deg(at).is_none() || !self.same(before, self.outcome_at(at))
    }

    fn same(&self, a: BeamOutcome, b: BeamOutcome) -> bool {
        match (a, b) {
            (BeamOutcome::Echo(a), BeamOutcome::Echo(b)) => (a - b).abs() <= self.tolerance_m,
            (BeamOutcome::BelowMinRange, BeamOutcome::BelowMinRange)
            | (BeamOutcome::NoEcho, BeamOutcome::NoEcho) => true,
            _ => false,
        }
    }

    /// Last beam of the region that begins at `first`, among the next `count` beams.
    fn last_of(&self, first: usize, count: usize, max_holes: usize) -> usize {
        let (mut last, mut at) = (first, first + 1);
        let (mut sum_m, mut members) = (0.0, 0.0);
        if let BeamOutcome::Echo(range_m) = self.outcome_at(first) {
            (sum_m, members) = (range_m, 1.0);
        }
        let bridged =
            if matches!(self.outcome_at(first), BeamOutcome::Echo(_)) { max_holes } else { 0 };
        while at < first + count && at - last <= bridged + 1 && self.gap_before_deg(at).is_some() {
            let mean = match self.outcome_at(first) {
                BeamOutcome::Echo(_) => BeamOutcome::Echo(sum_m / members),
                other => other,
            };
            if self.same(mean, self.outcome_at(at)) {
                last = at;
                if let BeamOutcome::Echo(range_m) = self.outcome_at(at) {
                    (sum_m, members) = (sum_m + range_m, members + 1.0);
                }
            }
            at += 1;
        }
        last
    }

    fn region(&self, first: usize, last: usize) -> Region {
        let beams = &self.sweep.beams;
        let beam = |at: usize| beams[at % beams.len()];
        let turned = |at: usize| beam(at).azimuth_deg + if at >= beams.len() { 360.0 } else { 0.0 };
        let ranges: Vec<f64> = (first..=last)
            .filter_map(|at| match self.outcome_at(at) {
                BeamOutcome::Echo(range_m) => Some(range_m),
                _ => None,
            })
            .collect();
        let range_m = match self.outcome_at(first) {
            BeamOutcome::Echo(_) => quantile(ranges, 0.5),
            _ => None,
        };
        let whole_turn = last - first + 1 == beams.len() && self.sweep.closed;
        let side = |outside: usize, gap_deg: Option<f64>| match (gap_deg, self.outcome_at(outside))
        {
            _ if whole_turn => (RegionBorder::Cut, self.sweep.step_deg),
            (None, _) => (RegionBorder::Cut, self.sweep.step_deg),
            (Some(gap), BeamOutcome::BelowMinRange) => (RegionBorder::Covered, gap),
            (Some(gap), BeamOutcome::Echo(other)) if range_m.is_some_and(|here| other < here) => {
                (RegionBorder::Covered, gap)
            }
            (Some(gap), _) => (RegionBorder::Own, gap),
        };
        let before = side(first + beams.len() - 1, self.gap_before_deg(first));
        let after = side(last + 1, self.gap_before_deg(last + 1));
        let shift = if first >= beams.len() { 360.0 } else { 0.0 };
        Region {
            beams: [beam(first).index, beam(last).index],
            azimuths_deg: [turned(first) - shift, turned(last) - shift],
            gaps_deg: [before.1, after.1],
            sides: [before.0, after.0],
            range_m,
            count: last - first + 1,
        }
    }
}
