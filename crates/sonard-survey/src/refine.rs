//! Joint estimate of poses and lines from the arcs that a plan explains, of any order.

use nalgebra::DMatrix;
use sonard_inverse::{SceneMotion, length_derivative};
use sonard_model::{
    geometry::{DVec2, Pose, wrap_180, wrap_pi},
    model::{Mechanism, Path, Reflector, Simulator},
};

use crate::{
    arc::Arc,
    arrangement::{LineArrangement, PieceSet, Run},
    feature::VirtualFeature,
    judge::Judge,
    normal::{NormalEquations, move_pose, pose_column},
    trace::{ExplainedArc, explain, predicted_arcs},
};

/// Standard deviation of the median range of an arc of many beams, and of few, metres.
const SIGMA_M: [f64; 2] = [0.002, 0.003];
const FEW_BEAMS: usize = 5;
/// Standard deviation of the bearing of an arc, degrees; more for a cut one.
const SIGMA_DEG: f64 = 0.4;
const CUT_SIGMA: f64 = 3.0;
/// Residuals beyond so many standard deviations count linearly.
const ROBUST: f64 = 2.0;
/// Share of the beams of an arc that must agree.
const SHARE: f64 = 0.4;
/// Prior standard deviations of a step: position and distance in metres, angle of a line and
/// heading in radians.
const PRIOR: [f64; 3] = [0.1, 0.052, 0.087];
/// Maximum change of a step in the same order.
const MAX_STEP: [f64; 3] = [0.02, 0.017, 0.026];

/// Assumptions of a refinement.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RefineSettings {
    /// Maximum difference of ranges that belong together, metres.
    pub(crate) gate_m: f64,
    /// Standard deviation of directions from a common square axis, radians; `None` without a tie.
    pub(crate) square_rad: Option<f64>,
}

/// Plan with its poses.
#[derive(Debug, Clone)]
pub(crate) struct PosedPlan {
    pub(crate) plan: LineArrangement,
    pub(crate) walls: PieceSet,
    pub(crate) poses: Vec<Pose>,
}

/// LineColumns of the lines with walls in normal equations, after those of the poses: direction, then
/// distance.
#[derive(Debug, Clone)]
pub(crate) struct LineColumns {
    lines: Vec<Option<usize>>,
    count: usize,
}

impl LineColumns {
    pub(crate) fn new(posed: &PosedPlan) -> Self {
        let mut count = 3 * posed.poses.len().saturating_sub(1);
        let mut lines = vec![None; posed.plan.lines.len()];
        for run in posed.plan.runs(&posed.walls) {
            lines[run.line].get_or_insert_with(|| {
                count += 2;
                count - 2
            });
        }
        Self { lines, count }
    }

    /// Number of columns in all.
    pub(crate) const fn count(&self) -> usize {
        self.count
    }

    /// Column of the direction of a line; `None` without walls on it.
    pub(crate) fn of(&self, line: usize) -> Option<usize> {
        self.lines.get(line).copied().flatten()
    }

    /// LineColumns of all directions.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.lines.iter().flatten().copied()
    }
}

/// Covariance of a refinement with its columns.
#[derive(Debug, Clone)]
pub(crate) struct PlanCovariance {
    matrix: DMatrix<f64>,
    /// Covariance of the poses by all readings, if known.
    poses: Option<DMatrix<f64>>,
    columns: LineColumns,
}

impl PlanCovariance {
    pub(crate) const fn new(matrix: DMatrix<f64>, columns: LineColumns) -> Self {
        Self { matrix, poses: None, columns }
    }

    /// Covariance with that of the poses from another estimate of the same columns.
    pub(crate) fn with_poses(mut self, poses: DMatrix<f64>) -> Self {
        self.poses = Some(poses);
        self
    }

    /// Standard deviations of a pose: x, y in metres and heading in degrees; 0 for the first.
    pub(crate) fn pose_sigma(&self, pose: usize) -> [f64; 3] {
        let Some(at) = pose_column(pose) else { return [0.0; 3] };
        let matrix = self.poses.as_ref().unwrap_or(&self.matrix);
        let sigma = |at: usize| matrix[(at, at)].max(0.0).sqrt();
        [sigma(at), sigma(at + 1), sigma(at + 2).to_degrees()]
    }

    /// Standard deviations of a line's direction, degrees, and of its distance at a position along
    /// it, metres.
    pub(crate) fn line_sigma(&self, line: usize, along_m: f64) -> Option<[f64; 2]> {
        let at = self.columns.of(line)?;
        let of = |a: usize, b: usize| self.matrix[(at + a, at + b)];
        let offset = of(1, 1) + along_m * along_m * of(0, 0) - 2.0 * along_m * of(0, 1);
        Some([of(0, 0).max(0.0).sqrt().to_degrees(), offset.max(0.0).sqrt()])
    }

    /// Covariance of the intersection of two lines, metres squared: xx, xy, yy.
    pub(crate) fn corner(&self, lines: [usize; 2], plan: &LineArrangement) -> Option<[f64; 3]> {
        let [a, b] = lines.map(|line| &plan.lines[line]);
        let point = a.meet(b)?;
        let mut rows: Vec<(usize, DVec2)> = Vec::new();
        for (own, other) in [(0, 1), (1, 0)] {
            let at = self.columns.of(lines[own])?;
            let [own, other] = [own, other].map(|of| &plan.lines[lines[of]]);
            // n_own . dx = change of the offset, n_other . dx = 0.
            let by_distance = other.along() / own.normal().dot(other.along());
            rows.push((at, -own.along_m(point) * by_distance));
            rows.push((at + 1, by_distance));
        }
        let mut sums = [0.0; 3];
        for &(at, by) in &rows {
            for &(other, by_other) in &rows {
                let of = self.matrix[(at, other)];
                sums[0] += of * by.x * by_other.x;
                sums[1] += of * by.x * by_other.y;
                sums[2] += of * by.y * by_other.y;
            }
        }
        Some(sums)
    }
}

/// Improves poses and lines together as far as the likelihood gains, and returns the covariance.
pub(crate) fn refine(
    posed: &mut PosedPlan,
    judge: &Judge,
    settings: &RefineSettings,
    steps: usize,
) -> Option<PlanCovariance> {
    const SHARES: [f64; 3] = [1.0, 0.5, 0.2];
    let mut best = judge.score_segments(&posed.plan.segments(&posed.walls));
    for _ in 0..2 {
        let mut far = posed.clone();
        for _ in 0..steps {
            if step(&mut far, judge, settings).is_none() {
                break;
            }
        }
        let mut is_better = false;
        for share in SHARES {
            let tried = between(posed, &far, share, judge.workspace.reach_m());
            let own = judge.at_poses(&tried.poses);
            let score = own.score_segments(&tried.plan.segments(&tried.walls));
            if score > best + 0.05 {
                (*posed, best, is_better) = (tried, score, true);
                break;
            }
        }
        if !is_better {
            break;
        }
    }
    let columns = LineColumns::new(posed);
    let normal = equations(posed, &columns, judge, settings)?;
    Some(PlanCovariance::new(normal.covariance()?, columns))
}

/// Plan part of the way from one to another.
fn between(from: &PosedPlan, to: &PosedPlan, share: f64, reach_m: f64) -> PosedPlan {
    let mut poses = from.poses.clone();
    for (pose, far) in poses.iter_mut().zip(&to.poses) {
        pose.x_m += share * (far.x_m - pose.x_m);
        pose.y_m += share * (far.y_m - pose.y_m);
        let turn_deg = wrap_180(far.heading_deg - pose.heading_deg);
        pose.heading_deg = wrap_180(pose.heading_deg + share * turn_deg);
    }
    let mut lines = from.plan.lines.clone();
    for (line, far) in lines.iter_mut().zip(&to.plan.lines) {
        line.normal_rad += share * (far.normal_rad - line.normal_rad);
        line.distance_m += share * (far.distance_m - line.distance_m);
        line.update_feet(&poses);
    }
    let (plan, walls) = from.plan.rebuilt(&from.walls, lines, &poses, reach_m);
    PosedPlan { plan, walls, poses }
}

/// One step of Gauss and Newton.
fn step(posed: &mut PosedPlan, judge: &Judge, settings: &RefineSettings) -> Option<()> {
    let columns = LineColumns::new(posed);
    let mut normal = equations(posed, &columns, judge, settings)?;
    for pose in 1..posed.poses.len() {
        let at = pose_column(pose)?;
        normal.hold(at, PRIOR[0]);
        normal.hold(at + 1, PRIOR[0]);
        normal.hold(at + 2, PRIOR[2]);
    }
    for at in columns.lines.iter().flatten() {
        normal.hold(*at, PRIOR[1]);
        normal.hold(at + 1, PRIOR[0]);
    }
    let step = normal.step(0.0)?;
    let mut excess: f64 = 1.0;
    let of_poses = 3 * (posed.poses.len() - 1);
    for (at, by) in step.iter().enumerate() {
        let max = match (at < of_poses, at % 3, (at.max(of_poses) - of_poses) % 2) {
            (true, 2, _) => MAX_STEP[2],
            (true, ..) | (false, _, 1) => MAX_STEP[0],
            (false, ..) => MAX_STEP[1],
        };
        excess = excess.max(by.abs() / max);
    }
    let step = step / excess;
    for (at, pose) in posed.poses.iter_mut().enumerate().skip(1) {
        let at = pose_column(at)?;
        move_pose(pose, [step[at], step[at + 1], step[at + 2]]);
    }
    let mut lines = posed.plan.lines.clone();
    for (line, at) in lines.iter_mut().zip(&columns.lines) {
        if let Some(at) = *at {
            line.normal_rad = wrap_pi(line.normal_rad + step[at]);
            line.distance_m += step[at + 1];
        }
        line.update_feet(&posed.poses);
    }
    (posed.plan, posed.walls) =
        posed.plan.rebuilt(&posed.walls, lines, &posed.poses, judge.workspace.reach_m());
    Some(())
}

/// Normal equations of all explained arcs, odometry and squareness.
fn equations(
    posed: &PosedPlan,
    columns: &LineColumns,
    judge: &Judge,
    settings: &RefineSettings,
) -> Option<NormalEquations> {
    let own = judge.at_poses(&posed.poses);
    let (simulator, predictions) = own.predictions(&posed.plan.segments(&posed.walls))?;
    let runs = posed.plan.runs(&posed.walls);
    let motions = motions(&posed.plan, &runs, columns);
    let rows = RowBuilder { posed, columns, simulator: &simulator, runs: &runs, motions };
    let mut normal = NormalEquations::new(columns.count);
    for (sweep, arcs) in judge.workspace.arcs.iter().enumerate() {
        let (readings, predictions) = (&judge.readings()[sweep], &predictions[sweep]);
        let predicted = predicted_arcs(sweep, readings, predictions);
        for arc in arcs {
            let explained = explain(arc, readings, predictions, settings.gate_m, SHARE);
            if let Some(explained) = explained.filter(|of| of.beams.len() >= 2.min(arc.beams.len()))
            {
                let errors = explained.range_errors_m(readings, predictions);
                rows.add_arc(&mut normal, &explained, errors, &predicted, settings.gate_m);
            }
        }
    }
    for (at, step) in judge.workspace.moves.iter().enumerate() {
        if let [from, to, ..] = &posed.poses[at..] {
            step.add_to(&mut normal, [from, to], [pose_column(at), pose_column(at + 1)]);
        }
    }
    if let Some(sigma_rad) = settings.square_rad {
        add_square(&mut normal, posed, columns, sigma_rad);
    }
    Some(normal)
}

/// Ties directions of lines to their common square axis.
fn add_square(
    normal: &mut NormalEquations,
    posed: &PosedPlan,
    columns: &LineColumns,
    sigma_rad: f64,
) {
    const MAX_OFF_RAD: f64 = 0.12;
    let used = posed.plan.lines.iter().zip(&columns.lines).filter(|(_, at)| at.is_some());
    let lines: Vec<_> = used.map(|(line, _)| line.clone()).collect();
    let Some(axis_rad) = crate::line::square_axis(&lines) else { return };
    for (line, at) in posed.plan.lines.iter().zip(&columns.lines) {
        let off_rad = crate::line::off_square_rad(line.normal_rad, axis_rad);
        if let Some(at) = *at
            && off_rad.abs() < MAX_OFF_RAD
        {
            normal.add(&[(at, 1.0)], -off_rad, sigma_rad, 1e3);
        }
    }
}

/// Velocities of the ends of walls by each number of each line, by column.
fn motions(
    plan: &LineArrangement,
    runs: &[Run],
    columns: &LineColumns,
) -> Vec<(usize, SceneMotion)> {
    let mut motions = Vec::new();
    for (moving, at) in columns.lines.iter().enumerate() {
        let Some(at) = *at else { continue };
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

/// Rows of arcs in the normal equations.
struct RowBuilder<'a> {
    posed: &'a PosedPlan,
    columns: &'a LineColumns,
    simulator: &'a Simulator,
    runs: &'a [Run],
    motions: Vec<(usize, SceneMotion)>,
}

impl RowBuilder<'_> {
    fn add_arc(
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
                Mechanism::Reflection(Reflector::Wall(_))
                    | Mechanism::Diffraction(_)
                    | Mechanism::Transducer
            )
        });
        if !is_known {
            return;
        }
        let sigma_m = SIGMA_M[usize::from(errors_m.len() <= FEW_BEAMS)];
        normal.add(&self.range_row(path, arc.sweep), median(errors_m), sigma_m, ROBUST);
        let off_deg = |other: &&Arc| wrap_180(other.azimuth_deg - arc.azimuth_deg).abs();
        let same = predicted
            .iter()
            .filter(|other| (other.range_m - arc.range_m).abs() < gate_m && off_deg(other) < 4.0)
            .min_by(|a, b| off_deg(a).total_cmp(&off_deg(b)));
        if let Some(same) = same {
            let is_cut = arc.is_cut || same.is_cut;
            let sigma_deg = SIGMA_DEG * if is_cut { CUT_SIGMA } else { 1.0 };
            let off_rad = wrap_180(arc.azimuth_deg - same.azimuth_deg).to_radians();
            let row = self.bearing_row(path, arc.sweep);
            normal.add(&row, off_rad, sigma_deg.to_radians(), ROBUST);
        }
    }

    /// Derivatives of the range of a path.
    fn range_row(&self, path: &Path, sweep: usize) -> Vec<(usize, f64)> {
        let place = self.posed.poses[sweep].position();
        let rate = |motion: &SceneMotion| {
            let scene = self.simulator.scene();
            0.5 * length_derivative(path, [place; 2], 0.0, scene, motion)
        };
        let mut row = Vec::new();
        if let Some(at) = pose_column(sweep) {
            for (offset, axis) in [DVec2::X, DVec2::Y].into_iter().enumerate() {
                row.push((at + offset, rate(&SceneMotion::for_transducer(axis))));
            }
        }
        let lines = self.motions.iter().map(|(at, motion)| (*at, rate(motion)));
        row.extend(lines.filter(|(_, by)| *by != 0.0));
        row
    }

    /// Derivatives of the azimuth of a path: those of its virtual feature if all are mirrors, else
    /// by the heading only.
    fn bearing_row(&self, path: &Path, sweep: usize) -> Vec<(usize, f64)> {
        const STEP: f64 = 1e-5;
        let mut row: Vec<(usize, f64)> =
            pose_column(sweep).map(|at| (at + 2, -1.0)).into_iter().collect();
        let Some(lines) = self.mirrors(path) else { return row };
        let place = self.posed.poses[sweep].position();
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
            let Some(at) = self.columns.lines[line] else { continue };
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

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    crate::arc::quantile(&values, 0.5)
}
