//! Final estimate of poses and walls by the exact likelihood of all readings.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sonard_inverse::{ErrorModel, Hypotheses, LogLikelihood, Parameter};

use crate::{
    arc::quantile,
    judge::Judge,
    normal::{NormalEquations, move_pose, pose_column},
    posed::{LineColumns, PosedPlan},
    trace::explain,
};

const MAX_STEPS: usize = 6;
/// Gain below which no further step is made, nats.
const MIN_GAIN: f64 = 0.05;
/// Scatter of the threshold from firing to firing, decibels.
const SIGMA_DB: f64 = 1.0;
/// Limits of the standard deviation of ranges, metres.
const SIGMA_M: [f64; 2] = [0.0005, 0.02];

/// Log-likelihood of all sweeps with the normal equations of poses and lines.
struct Linearized {
    value: f64,
    normal: NormalEquations,
}

/// Improves poses and the distances of lines by the likelihood of all readings: ranges, missing
/// echoes and the ends of arcs. Directions of lines remain. Returns `None` if the normal equations
/// have no solution.
pub(crate) fn polish(posed: &mut PosedPlan, judge: &Judge) -> Option<()> {
    let errors = error_model(posed, judge)?;
    let mut best = linearize(posed, judge, &errors)?;
    let mut damping = 1e-3;
    for _ in 0..MAX_STEPS {
        let step = best.normal.step(damping)?;
        let tried = moved(posed, &step, judge);
        let Some(at) = linearize(&tried, judge, &errors) else { break };
        let gain = at.value - best.value;
        if gain <= 0.0 {
            damping *= 30.0;
            continue;
        }
        (*posed, best, damping) = (tried, at, 0.1 * damping);
        if gain < MIN_GAIN {
            break;
        }
    }
    Some(())
}

/// Error model with the observed scatter of ranges.
fn error_model(posed: &PosedPlan, judge: &Judge) -> Option<ErrorModel> {
    const GATE_M: f64 = 0.03;
    /// Standard deviation of a normal distribution, in median absolute deviations.
    const PER_MEDIAN: f64 = 1.483;
    let own = judge.at_poses(&posed.poses);
    let (_, predictions) = own.predictions(&posed.plan.segments(&posed.walls))?;
    let mut errors_m = Vec::new();
    for arc in judge.workspace.arcs.iter().flatten() {
        let (readings, predictions) = (&own.readings()[arc.sweep], &predictions[arc.sweep]);
        if let Some(explained) = explain(arc, readings, predictions, GATE_M, 0.5) {
            let errors = explained.range_errors_m(readings, predictions);
            errors_m.extend(errors.into_iter().map(f64::abs));
        }
    }
    errors_m.sort_by(f64::total_cmp);
    let sigma_m = (PER_MEDIAN * quantile(&errors_m, 0.5)).clamp(SIGMA_M[0], SIGMA_M[1]);
    let reach_m = judge.workspace.reach_m();
    let rough = ErrorModel::rough(sigma_m, SIGMA_DB, reach_m);
    Some(ErrorModel { outlier_share: 0.03, outlier_arc_share: 0.03, ..rough })
}

/// Predicts all sweeps with their derivatives.
fn linearize(posed: &PosedPlan, judge: &Judge, errors: &ErrorModel) -> Option<Linearized> {
    let workspace = judge.workspace;
    let segments = posed.plan.segments(&posed.walls);
    let mut world = workspace.world.clone();
    world.scene = Arc::new(judge.scene_of(&segments));
    let mut parameters = vec![Parameter::X(0), Parameter::Y(0), Parameter::Heading(0)];
    parameters.extend((0..segments.len()).map(Parameter::Wall));
    let hypotheses = Hypotheses::new(world, parameters).ok()?;
    let of_sweep = |(sweep, pose)| hypotheses.log_likelihood(sweep, pose, errors).ok();
    let pairs = workspace.sweeps.par_iter().zip(&posed.poses);
    let all: Option<Vec<LogLikelihood>> = pairs.map(of_sweep).collect();
    let columns = LineColumns::new(posed);
    let mut normal = NormalEquations::new(columns.count());
    let mut value = 0.0;
    for (sweep, likelihood) in all?.iter().enumerate() {
        value += likelihood.value;
        // Headings are in degrees there and in radians here. The normal of a wall points to its
        // left, against that of its line.
        let of_pose = [(0, 1.0), (1, 1.0), (2, 1f64.to_degrees())]
            .map(|(offset, unit)| pose_column(sweep).map(|at| (at + offset, unit)));
        let of_walls =
            segments.iter().map(|wall| columns.of(wall.line).map(|column| (column + 1, -1.0)));
        let map: Vec<Option<(usize, f64)>> = of_pose.into_iter().chain(of_walls).collect();
        add_mapped(&mut normal, &map, &likelihood.gradient, &likelihood.information);
    }
    for (at, step) in workspace.moves.iter().enumerate() {
        if let [from, to, ..] = &posed.poses[at..] {
            value -= step.loss(from, to);
            step.add_to(&mut normal, [from, to], [pose_column(at), pose_column(at + 1)]);
        }
    }
    for column in columns.iter() {
        // Directions are fixed.
        normal.hold(column, 1e-9);
    }
    Some(Linearized { value, normal })
}

/// Adds a gradient and an information matrix whose parameters are multiples of columns.
fn add_mapped(
    normal: &mut NormalEquations,
    map: &[Option<(usize, f64)>],
    gradient: &DVector<f64>,
    information: &DMatrix<f64>,
) {
    for (at, of) in map.iter().enumerate() {
        let Some((row, unit)) = *of else { continue };
        normal.add_gradient(row, unit * gradient[at]);
        for (other, by) in map.iter().enumerate() {
            if let Some((column, by)) = *by {
                normal.add_information(row, column, unit * by * information[(at, other)]);
            }
        }
    }
}

/// Plan and poses after a step.
fn moved(posed: &PosedPlan, step: &DVector<f64>, judge: &Judge) -> PosedPlan {
    let columns = LineColumns::new(posed);
    let mut poses = posed.poses.clone();
    for (at, pose) in poses.iter_mut().enumerate() {
        if let Some(column) = pose_column(at) {
            move_pose(pose, [0, 1, 2].map(|offset| step[column + offset]));
        }
    }
    let mut lines = posed.plan.lines.clone();
    for (at, line) in lines.iter_mut().enumerate() {
        if let Some(column) = columns.of(at) {
            line.distance_m += step[column + 1];
        }
        line.update_feet(&poses);
    }
    let reach_m = judge.workspace.reach_m();
    let (plan, walls) = posed.plan.rebuilt(&posed.walls, lines, &poses, reach_m);
    PosedPlan { plan, walls, poses }
}
