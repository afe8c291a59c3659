//! Rows of explained arcs in normal equations.

use sonard_inverse::{SceneMotion, length_derivative};
use sonard_model::{
    geometry::{DVec2, wrap_180, wrap_pi},
    model::{Diffractor, Mechanism, Path, Reflector, Simulator},
};

use crate::{
    arc::{Arc, blurred, quantile},
    arrangement::{LineArrangement, Run},
    feature::VirtualFeature,
    judge::mean_direction,
    normal::{NormalEquations, pose_column},
    posed::{LineColumns, PosedPlan},
    range_errors::RangeErrors,
    trace::ExplainedArc,
};

/// Standard deviation of the median range of an arc of many beams, and of few, metres.
const SIGMA_M: [f64; 2] = [0.002, 0.003];
const FEW_BEAMS: usize = 5;
/// Standard deviation of the bearing of an arc, degrees; more for a cut one.
const SIGMA_DEG: f64 = 0.4;
const CUT_SIGMA: f64 = 3.0;
/// Residuals beyond so many standard deviations count linearly.
const ROBUST: f64 = 2.0;

/// Rows of arcs in the normal equations.
pub(crate) struct RowBuilder<'a> {
    posed: &'a PosedPlan,
    columns: &'a LineColumns,
    simulator: &'a Simulator,
    errors: RangeErrors,
    runs: &'a [Run],
    motions: Vec<(usize, SceneMotion)>,
}

impl<'a> RowBuilder<'a> {
    pub(crate) fn new(
        posed: &'a PosedPlan,
        columns: &'a LineColumns,
        (simulator, errors): (&'a Simulator, RangeErrors),
        runs: &'a [Run],
    ) -> Self {
        Self { posed, columns, simulator, errors, runs, motions: motions(posed, runs, columns) }
    }

    /// Adds range and bearing of an arc, measured minus predicted.
    pub(crate) fn add_arc(
        &self,
        normal: &mut NormalEquations,
        explained: &ExplainedArc,
        errors_m: Vec<f64>,
        predicted: &[Arc],
        gate_m: f64,
    ) {
        let Some(path) = explained.path() else { return };
        let arc = explained.arc;
        let is_known = path.mechanisms().all(|mechanism| {
            matches!(
                mechanism,
                Mechanism::Reflection(Reflector::Wall(_) | Reflector::Cylinder(_))
                    | Mechanism::Diffraction(_)
                    | Mechanism::Transducer
            )
        });
        if !is_known {
            return;
        }
        let sigma_m = self.errors.sigma_m(SIGMA_M[usize::from(errors_m.len() <= FEW_BEAMS)]);
        normal.add(&self.range_row(explained, path), median(errors_m), sigma_m, ROBUST);
        let Some((off_rad, sigma_rad)) = self.bearing_error(explained, predicted, gate_m) else {
            return;
        };
        normal.add(&self.bearing_row(path, arc.sweep), off_rad, sigma_rad, ROBUST);
    }

    /// Measured minus predicted bearing of an arc, and its standard deviation, radians.
    ///
    /// That of a single beam is known within the step between beams; that of several is the middle
    /// of the arc, compared with that of the predicted arc.
    fn bearing_error(
        &self,
        explained: &ExplainedArc,
        predicted: &[Arc],
        gate_m: f64,
    ) -> Option<(f64, f64)> {
        let arc = explained.arc;
        if arc.beams.len() == 1 {
            let pose = &self.posed.poses[arc.sweep];
            let arrival = explained.prediction.arrival.as_ref()?;
            let from_rad = mean_direction(arrival).to_angle();
            let off_rad = wrap_pi(pose.direction_rad(arc.azimuth_deg) - from_rad);
            return Some((off_rad, (arc.step_deg / 12_f64.sqrt()).to_radians()));
        }
        let off_deg = |other: &&Arc| wrap_180(other.azimuth_deg - arc.azimuth_deg).abs();
        let same = predicted
            .iter()
            .filter(|other| (other.range_m - arc.range_m).abs() < gate_m && off_deg(other) < 4.0)
            .min_by(|a, b| off_deg(a).total_cmp(&off_deg(b)))?;
        let sigma_deg = SIGMA_DEG * if arc.is_cut || same.is_cut { CUT_SIGMA } else { 1.0 };
        let sigma_deg = self.errors.bearing_factor() * blurred(sigma_deg, arc.step_deg);
        let off_rad = wrap_180(arc.azimuth_deg - same.azimuth_deg).to_radians();
        Some((off_rad, sigma_deg.to_radians()))
    }

    /// Derivatives of the range of a path.
    fn range_row(&self, explained: &ExplainedArc, path: &Path) -> Vec<(usize, f64)> {
        let arc = explained.arc;
        let (sweep, pose) = (arc.sweep, &self.posed.poses[arc.sweep]);
        let place = pose.position();
        let rate = |motion: &SceneMotion| {
            let scene = self.simulator.scene();
            0.5 * length_derivative(path, [place; 2], 0.0, scene, motion)
        };
        let mut row = Vec::new();
        if let Some(at) = pose_column(sweep) {
            for (offset, axis) in [DVec2::X, DVec2::Y].into_iter().enumerate() {
                row.push((at + offset, rate(&SceneMotion::for_transducer(axis))));
            }
            if arc.face != DVec2::ZERO
                && let Some(arrival) = &explained.prediction.arrival
            {
                row.push((at + 2, -arc.face_of(pose).perp().dot(mean_direction(arrival))));
            }
        }
        let lines = self.motions.iter().map(|(at, motion)| (*at, rate(motion)));
        row.extend(lines.filter(|(_, by)| *by != 0.0));
        row
    }

    /// Derivatives of the azimuth of a path: those of its virtual feature if all are mirrors, those
    /// of the centre of a post that returns it directly, else by the heading only.
    fn bearing_row(&self, path: &Path, sweep: usize) -> Vec<(usize, f64)> {
        const STEP: f64 = 1e-5;
        let mut row: Vec<(usize, f64)> =
            pose_column(sweep).map(|at| (at + 2, -1.0)).into_iter().collect();
        let place = self.posed.poses[sweep].position();
        if let Some(post) = direct_post(path) {
            let to = self.posed.posts[post].center - place;
            let across = to.perp() / to.length_squared();
            let at = self.columns.of_post(post);
            row.extend([(at, across.x), (at + 1, across.y)]);
            if let Some(at) = pose_column(sweep) {
                row.extend([(at, -across.x), (at + 1, -across.y)]);
            }
            return row;
        }
        let Some(lines) = self.mirrors(path) else { return row };
        let numbers = |line: usize| {
            let line = &self.posed.plan.lines[line];
            (line.normal_rad, line.distance_m)
        };
        let bearing = |place: DVec2, changed: Option<(usize, [f64; 2])>| {
            let mirror = |&line: &usize| {
                let (normal_rad, distance_m) = numbers(line);
                match changed {
                    Some((moving, by)) if moving == line => {
                        (normal_rad + by[0], distance_m + by[1])
                    }
                    _ => (normal_rad, distance_m),
                }
            };
            let mirrors: Vec<_> = lines.iter().map(mirror).collect();
            VirtualFeature::from_mirrors(&mirrors).map(|feature| feature.predict(place).1)
        };
        let difference = |ends: [Option<f64>; 2]| match ends {
            [Some(low), Some(high)] => wrap_pi(high - low) / (2.0 * STEP),
            _ => 0.0,
        };
        if let Some(at) = pose_column(sweep) {
            for (offset, axis) in [DVec2::X, DVec2::Y].into_iter().enumerate() {
                let ends = [-STEP, STEP].map(|by| bearing(place + by * axis, None));
                row.push((at + offset, difference(ends)));
            }
        }
        let mut moving = lines.clone();
        moving.sort_unstable();
        moving.dedup();
        for line in moving {
            let Some(at) = self.columns.of(line) else { continue };
            for (offset, axis) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
                let ends = [-STEP, STEP]
                    .map(|by| bearing(place, Some((line, axis.map(|of: f64| by * of)))));
                row.push((at + offset, difference(ends)));
            }
        }
        row
    }

    /// Lines of a path that is reflected by walls only.
    fn mirrors(&self, path: &Path) -> Option<Vec<usize>> {
        let line = |mechanism: Mechanism| match mechanism {
            Mechanism::Reflection(Reflector::Wall(wall)) => {
                self.runs.get(wall as usize).map(|run| run.line)
            }
            _ => None,
        };
        path.mechanisms().map(line).collect()
    }
}

/// Post that returns an echo directly.
pub(crate) fn direct_post(path: &Path) -> Option<usize> {
    let mut mechanisms = path.mechanisms();
    match (mechanisms.next(), mechanisms.next()) {
        (
            Some(
                Mechanism::Reflection(Reflector::Cylinder(post))
                | Mechanism::Diffraction(Diffractor::Post { cylinder: post }),
            ),
            None,
        ) => Some(post as usize),
        _ => None,
    }
}

/// Velocities of the ends of walls by each number of each line, and of posts, by column.
fn motions(
    PosedPlan { plan, posts, .. }: &PosedPlan,
    runs: &[Run],
    columns: &LineColumns,
) -> Vec<(usize, SceneMotion)> {
    let mut motions = Vec::new();
    for (moving, at) in columns.lines().enumerate() {
        let Some(at) = at else { continue };
        for is_distance in [false, true] {
            let walls = runs.iter().zip(0u32..).filter_map(|(run, wall)| {
                let ends = [run.first, run.last + 1]
                    .map(|cut| end_velocity(plan, run.line, cut, moving, is_distance));
                (ends != [DVec2::ZERO; 2]).then_some((wall, ends))
            });
            let motion = SceneMotion { walls: walls.collect(), ..SceneMotion::default() };
            motions.push((at + usize::from(is_distance), motion));
        }
    }
    for post in 0..posts.len() {
        let parts = [(DVec2::X, 0.0), (DVec2::Y, 0.0), (DVec2::ZERO, 1.0)];
        for (offset, (velocity, growth)) in parts.into_iter().enumerate() {
            let cylinders = vec![(post as u32, velocity, growth)];
            let motion = SceneMotion { cylinders, ..SceneMotion::default() };
            motions.push((columns.of_post(post) + offset, motion));
        }
    }
    motions
}

/// Velocity of an end of a wall by the distance of a line, or by its direction.
fn end_velocity(
    plan: &LineArrangement,
    line: usize,
    cut: usize,
    moving: usize,
    is_distance: bool,
) -> DVec2 {
    let own = &plan.lines[line];
    let cut = plan.cuts[line][cut];
    let met = cut.by.and_then(|by| Some((by, own.meet(&plan.lines[by])?)));
    let rate = |point: DVec2| {
        if is_distance { 1.0 } else { -plan.lines[moving].along_m(point) }
    };
    match met {
        None if moving == line => {
            let point = own.at(cut.along_m);
            rate(point) * own.normal()
        }
        // The end is on both lines: n . dx is the change of the moving one, and 0 on the other.
        Some((by, point)) if moving == line || moving == by => {
            let (moved, fixed) = match moving == line {
                true => (own, &plan.lines[by]),
                false => (&plan.lines[by], own),
            };
            rate(point) * fixed.along() / moved.normal().dot(fixed.along())
        }
        _ => DVec2::ZERO,
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    quantile(&values, 0.5)
}
