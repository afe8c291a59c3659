//! Evidence of one scan by direction and distance from the ranger.

use std::f64::consts::TAU;

use super::{BeamModel, GridShape, MAX_LOG_ODDS, ScanEvidence, Trust};
use crate::interpret::{BeamOutcome, SweepBeam, prediction::Assessment};
use sonard_model::geometry::DVec2;

/// Number of directions: 0.75 degrees each, finer than the motor's steps.
const DIRECTIONS: usize = 480;

/// Extent of the occupied zone beyond the reading, in standard deviations.
const REACH_SIGMAS: f64 = 3.0;

/// Polar log-odds table of the readings of a scan.
pub(super) struct PolarTable {
    /// Log-odds by direction, then by distance in steps of a cell.
    log_odds: Vec<f32>,
    distances: usize,
    /// Number of affected distances in each direction.
    reach: Vec<usize>,
    cell_m: f64,
    /// Readings discarded for low confidence.
    pub(super) discarded: usize,
}

impl PolarTable {
    /// Table of the readings taken at one position on the robot.
    pub(super) fn new(evidence: ScanEvidence<'_>, mount: DVec2, cell_m: f64) -> Self {
        let ScanEvidence { sweep, assessments, model, trust } = evidence;
        let max_m = model.max_range_m() + 0.2;
        let distances = (max_m / cell_m).ceil() as usize + 1;
        let mut table = Self {
            log_odds: vec![0.0; DIRECTIONS * distances],
            distances,
            reach: vec![0; DIRECTIONS],
            cell_m,
            discarded: 0,
        };
        // Overlapping beams detect the same targets: together they count as much as adjacent beams
        // without overlap.
        let share = (sweep.step_deg / model.width_deg()).clamp(0.0, 1.0);
        let mut profiles = [vec![0.0; distances], vec![0.0; distances]];
        let here = |(_, beam): &(usize, &SweepBeam)| beam.mount == mount;
        for (at, beam) in sweep.beams.iter().enumerate().filter(here) {
            let assessment = assessments.and_then(|assessments| assessments.get(at));
            let (range_m, echo) = match beam.outcome {
                BeamOutcome::Echo(range_m) if range_m <= model.max_range_m() => (range_m, true),
                BeamOutcome::Echo(_) | BeamOutcome::NoEcho => (model.max_range_m(), false),
                BeamOutcome::BelowMinRange => continue,
            };
            if assessment.is_some_and(|assessment| assessment.confidence < trust.min_confidence) {
                table.discarded += 1;
                if !trust.keep_clear {
                    continue;
                }
            }
            let reading = WeightedReading { range_m, echo, share, assessment, trust };
            let axis_rad = sweep.pose.direction_rad(beam.azimuth_deg);
            table.add(&reading, axis_rad, model, &mut profiles);
        }
        table
    }

    fn add(
        &mut self,
        reading: &WeightedReading<'_>,
        axis_rad: f64,
        model: &BeamModel,
        [free, occupied]: &mut [Vec<f32>; 2],
    ) {
        let profile = model.profile(reading.range_m, self.cell_m);
        let end_m = reading.range_m + REACH_SIGMAS * profile.range_sigma_m;
        let count = ((end_m / self.cell_m).ceil() as usize).min(self.distances);
        for distance in 0..count {
            let distance_m = (distance as f64 + 0.5) * self.cell_m;
            let weight = reading.share * reading.weight(distance_m);
            let off = (distance_m - reading.range_m) / profile.range_sigma_m;
            let there = if reading.echo { (-0.5 * off * off).exp() } else { 0.0 };
            // Moravec and Elfes: certainty of free space decreases towards the reading.
            let share = distance_m / reading.range_m;
            let before = (1.0 - share * share).max(0.0);
            free[distance] = (weight * profile.free * before) as f32;
            occupied[distance] = (weight * profile.occupied * there) as f32;
        }
        let bin_rad = TAU / DIRECTIONS as f64;
        let first = ((axis_rad - profile.half_rad) / bin_rad).ceil() as i64;
        let last = ((axis_rad + profile.half_rad) / bin_rad).floor() as i64;
        for bin in first..=last.min(first + DIRECTIONS as i64 - 1) {
            let off_rad = bin as f64 * bin_rad - axis_rad;
            let [of_free, of_occupied] =
                model.off_axis(off_rad, profile.half_rad).map(|weight| weight as f32);
            let direction = bin.rem_euclid(DIRECTIONS as i64) as usize;
            let row = &mut self.log_odds[direction * self.distances..][..count];
            for ((cell, free), occupied) in row.iter_mut().zip(&*free).zip(&*occupied) {
                *cell += of_free * free + of_occupied * occupied;
            }
            self.reach[direction] = self.reach[direction].max(count);
        }
    }

    /// Adds each entry to its cells around `from`.
    ///
    /// Cells are indexed relative to the world cell that contains `from`, so that a cell receives
    /// exactly the same value in every grid that contains it.
    pub(super) fn add_to(&self, shape: &GridShape, from: DVec2, cells: &mut [f32]) {
        let place = from / shape.resolution_m;
        if !place.is_finite() {
            return;
        }
        let (home, (corner, rest)) = (place.floor(), shape.corner_in_cells());
        let (to_corner, within) = (corner - home, rest - (place - home));
        let [low, high] =
            self.box_in_cells(shape.resolution_m).map(|side| side - to_corner - within);
        let range = |low: f64, high: f64, count: usize| {
            let within = |cell: f64| cell.clamp(0.0, count as f64) as usize;
            within(low.floor())..within(high.ceil())
        };
        let columns = range(low.x, high.x, shape.width);
        let per_radian = DIRECTIONS as f32 / TAU as f32;
        let middle = within + 0.5;
        for row in range(low.y, high.y, shape.height) {
            let dy = (row as f64 + to_corner.y + middle.y) as f32;
            let line = &mut cells[row * shape.width..][..shape.width];
            for column in columns.clone() {
                let dx = (column as f64 + to_corner.x + middle.x) as f32;
                let distance = (dx * dx + dy * dy).sqrt() as usize;
                if distance >= self.distances {
                    continue;
                }
                let turn = angle(dy, dx) * per_radian + 0.5 + DIRECTIONS as f32;
                let direction = turn as usize % DIRECTIONS;
                let change = self.log_odds[direction * self.distances + distance];
                let cell = &mut line[column];
                *cell = (*cell + change).clamp(-MAX_LOG_ODDS, MAX_LOG_ODDS);
            }
        }
    }

    /// Lower left and upper right corner of the affected region relative to the ranger, cells.
    pub(super) fn box_in_cells(&self, resolution_m: f64) -> [DVec2; 2] {
        let bin_rad = TAU / DIRECTIONS as f64;
        let affected = self.reach.iter().enumerate().filter(|(_, reach)| **reach > 0);
        let sides = affected.flat_map(|(direction, reach)| {
            let reach = *reach as f64 * self.cell_m / resolution_m;
            // Each direction covers half a bin to either side.
            [-0.5, 0.5].map(|off| reach * DVec2::from_angle((direction as f64 + off) * bin_rad))
        });
        let corners = sides.fold([DVec2::ZERO; 2], |[low, high], at| [low.min(at), high.max(at)]);
        // An arc bulges slightly beyond its ends.
        [corners[0] - 1.0, corners[1] + 1.0]
    }
}

/// Reading weighted with its confidence.
struct WeightedReading<'a> {
    range_m: f64,
    echo: bool,
    share: f64,
    assessment: Option<&'a Assessment>,
    trust: &'a Trust,
}

impl WeightedReading<'_> {
    /// Weight at a distance: 1 without contradiction, 0 without confidence.
    fn weight(&self, distance_m: f64) -> f64 {
        let Some(assessment) = self.assessment else { return 1.0 };
        if self.trust.keep_clear && assessment.clear_m.is_some_and(|clear_m| distance_m < clear_m) {
            return 1.0;
        }
        if assessment.confidence < self.trust.min_confidence {
            return 0.0;
        }
        (2.0 * assessment.confidence).clamp(0.0, 1.0)
    }
}

/// Angle of a vector, radians, accurate to 0.0004 (a hundredth of a table direction).
///
/// Rational approximation of the arctangent on [0, 1] after S. Rajan and others, "Efficient
/// approximations for the arctangent function", IEEE Signal Processing Magazine 23 (2006).
fn angle(y: f32, x: f32) -> f32 {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let (small, large) = (x.abs().min(y.abs()), x.abs().max(y.abs()));
    if large == 0.0 {
        return 0.0;
    }
    let ratio = small / large;
    let mut angle = ratio * (FRAC_PI_4 - (ratio - 1.0) * (0.2447 + 0.0663 * ratio));
    if y.abs() > x.abs() {
        angle = FRAC_PI_2 - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    if y < 0.0 { -angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::angle;

    #[test]
    fn fast_angle_is_accurate() {
        for i in -3600..3600 {
            let exact = f64::from(i) * 0.05_f64.to_radians();
            let quick = angle(exact.sin() as f32, exact.cos() as f32);
            let off = sonard_model::geometry::wrap_pi(f64::from(quick) - exact).abs();
            assert!(off < 0.0016, "{exact}: {off}");
        }
    }
}
