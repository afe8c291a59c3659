//! Final estimate of poses and walls by the exact likelihood of all readings.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sonard_inverse::{ErrorModel, Hypotheses, LogLikelihood, Parameter, PostPart};

use crate::{
    arc::{Arc, quantile},
    arrangement::Segment,
    judge::Judge,
    normal::{NormalEquations, pose_column},
    posed::{LineColumns, PosedPlan},
    sensor_fit::FreeNumbers,
    trace::explain,
};

const MAX_STEPS: usize = 6;
/// Gain below which no further step is made, nats.
const MIN_GAIN: f64 = 0.05;
/// Scatter of the threshold from firing to firing before it is estimated, and choices, decibels.
const SIGMA_DB: f64 = 1.0;
const SPREADS_DB: [f64; 6] = [0.35, 0.5, 0.7, 1.0, 1.5, 2.5];
/// Limits of the standard deviation of ranges, metres.
const SIGMA_M: [f64; 2] = [0.0005, 0.02];

/// Plan, poses, and numbers of sensor and air, which are estimated together.
#[derive(Debug, Clone)]
struct Estimate {
    posed: PosedPlan,
    numbers: FreeNumbers,
}

/// Log-likelihood of all sweeps with the normal equations of poses, lines, posts and numbers.
struct Linearized {
    value: f64,
    normal: NormalEquations,
}

/// Improves poses, lines and posts by the likelihood of all readings: ranges, missing echoes and
/// the ends of arcs. Directions are tied to a square axis if the survey assumes one. Returns `None` if the
/// normal equations have no solution.
pub(crate) fn polish(posed: &mut PosedPlan, judge: &Judge) -> Option<()> {
    let (polished, _) = polish_with(posed, judge, FreeNumbers::none())?;
    *posed = polished.posed;
    Some(())
}

/// Improves poses, lines and posts as [`polish`], together with numbers of sensor and air; returns
/// these with their covariance.
pub(crate) fn fit_numbers(
    posed: &mut PosedPlan,
    judge: &Judge,
    numbers: FreeNumbers,
) -> Option<(FreeNumbers, Option<DMatrix<f64>>)> {
    let count = numbers.count();
    let (fitted, linear) = polish_with(posed, judge, numbers)?;
    let covariance = linear.normal.covariance();
    let own = covariance.map(|of| {
        let first = of.nrows() - count;
        of.view((first, first), (count, count)).into_owned()
    });
    *posed = fitted.posed;
    Some((fitted.numbers, own))
}

fn polish_with(
    posed: &PosedPlan,
    judge: &Judge,
    numbers: FreeNumbers,
) -> Option<(Estimate, Linearized)> {
    let mut estimate = Estimate { posed: posed.clone(), numbers };
    let rough = error_model(&estimate.posed, judge)?;
    climb(&mut estimate, judge, &rough)?;
    let errors = error_model(&estimate.posed, judge)?;
    let errors = likeliest_spread(&estimate, judge, &errors)?;
    let linear = climb(&mut estimate, judge, &errors)?;
    Some((estimate, linear))
}

/// Maximizes the likelihood under an error model.
fn climb(estimate: &mut Estimate, judge: &Judge, errors: &ErrorModel) -> Option<Linearized> {
    let workspace = judge.workspace;
    let mut best = linearize(estimate, judge, errors)?;
    let mut damping = 1e-3;
    for _ in 0..MAX_STEPS {
        let step = best.normal.step(damping)?;
        let columns = LineColumns::new(&estimate.posed);
        let tried = Estimate {
            posed: estimate.posed.moved(&columns, &step, workspace.reach_m()),
            numbers: estimate.numbers.moved(&step.as_slice()[columns.count()..], &workspace.world),
        };
        let Some(at) = linearize(&tried, judge, errors) else { break };
        let gain = at.value - best.value;
        if gain <= 0.0 {
            damping *= 30.0;
            continue;
        }
        (*estimate, best, damping) = (tried, at, 0.1 * damping);
        if gain < MIN_GAIN {
            break;
        }
    }
    Some(best)
}

/// Error model with the scatter of the threshold that is most likely.
fn likeliest_spread(estimate: &Estimate, judge: &Judge, errors: &ErrorModel) -> Option<ErrorModel> {
    let of = |sigma_db: f64| ErrorModel { sigma_db, ..*errors };
    let scored = SPREADS_DB.iter().filter_map(|&sigma_db| {
        let errors = of(sigma_db);
        Some((linearize(estimate, judge, &errors)?.value, errors))
    });
    scored.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, errors)| errors)
}

/// Error model with the observed scatter of ranges.
fn error_model(posed: &PosedPlan, judge: &Judge) -> Option<ErrorModel> {
    /// Standard deviation of a normal distribution, in median absolute deviations.
    const PER_MEDIAN: f64 = 1.483;
    let mut errors_m = absolute_errors_m(posed, judge)?;
    errors_m.sort_by(f64::total_cmp);
    let sigma_m = (PER_MEDIAN * quantile(&errors_m, 0.5)).clamp(SIGMA_M[0], SIGMA_M[1]);
    let reach_m = judge.workspace.reach_m();
    let rough = ErrorModel::rough(sigma_m, SIGMA_DB, reach_m);
    Some(ErrorModel { outlier_share: 0.03, outlier_arc_share: 0.03, ..rough })
}

/// Absolute errors of the predicted ranges of all explained arcs, metres.
fn absolute_errors_m(posed: &PosedPlan, judge: &Judge) -> Option<Vec<f64>> {
    const GATE_M: f64 = 0.03;
    let gate_m = judge.workspace.errors.gate_m(GATE_M);
    let own = judge.at(posed);
    let (_, predictions) = own.predictions(&posed.plan.segments(&posed.walls))?;
    let of_arc = |arc: &Arc| {
        let (readings, predictions) = (&own.readings()[arc.sweep], &predictions[arc.sweep]);
        let explained = explain(arc, readings, predictions, gate_m, 0.5)?;
        Some(explained.range_errors_m(readings, predictions))
    };
    let errors_m = judge.workspace.arcs.iter().flatten().filter_map(of_arc).flatten();
    Some(errors_m.map(f64::abs).collect())
}

/// Predicts all sweeps with their derivatives.
fn linearize(estimate: &Estimate, judge: &Judge, errors: &ErrorModel) -> Option<Linearized> {
    let Estimate { posed, numbers } = estimate;
    let workspace = judge.workspace;
    let segments = posed.plan.segments(&posed.walls);
    let mut world = workspace.world.clone();
    world.sensor.mounting.left_m = workspace.left_m;
    world.scene = std::sync::Arc::new(judge.with_posts(&posed.posts).scene_of(&segments));
    let mut parameters = vec![Parameter::X(0), Parameter::Y(0), Parameter::Heading(0)];
    parameters.extend((0..segments.len()).map(Parameter::Wall));
    parameters.extend((0..segments.len()).map(Parameter::WallTurn));
    let parts = [PostPart::X, PostPart::Y, PostPart::Radius];
    let of_post = |post: usize| parts.map(|part| Parameter::Post(post, part));
    parameters.extend((0..posed.posts.len()).flat_map(of_post));
    parameters.extend(numbers.parameters());
    let hypotheses = Hypotheses::new(numbers.changed(&world)?, parameters).ok()?;
    let of_sweep = |(sweep, pose)| hypotheses.log_likelihood(sweep, pose, errors).ok();
    let pairs = workspace.sweeps.par_iter().zip(&posed.poses);
    let all: Option<Vec<LogLikelihood>> = pairs.map(of_sweep).collect();
    let columns = LineColumns::new(posed);
    let mut normal = NormalEquations::new(columns.count() + numbers.count());
    let mut value = 0.0;
    for (sweep, likelihood) in all?.iter().enumerate() {
        value += likelihood.value;
        let mut map = parameter_columns(posed, &segments, &columns, sweep);
        map.extend((0..numbers.count()).map(|at| vec![(columns.count() + at, 1.0)]));
        add_mapped(&mut normal, &map, &likelihood.gradient, &likelihood.information);
    }
    for (at, step) in workspace.moves.iter().enumerate() {
        if let [from, to, ..] = &posed.poses[at..] {
            value -= step.loss(from, to);
            step.add_to(&mut normal, [from, to], [pose_column(at), pose_column(at + 1)]);
        }
    }
    if let Some(sigma_rad) = workspace.square_rad {
        let before = normal.loss();
        columns.add_square(&mut normal, &posed.plan, sigma_rad);
        value -= normal.loss() - before;
    }
    value -= numbers.add_priors(&mut normal, columns.count());
    Some(Linearized { value, normal })
}

/// Derivatives of the parameters of a sweep (its pose, the offsets of all walls, their turns, the
/// posts) by columns of the normal equations.
///
/// Headings and turns are in degrees there and in radians here. The normal of a wall points to its
/// left, against that of its line, and a wall turns about its middle, a line about the foot of the
/// origin.
fn parameter_columns(
    posed: &PosedPlan,
    segments: &[Segment],
    columns: &LineColumns,
    sweep: usize,
) -> Vec<Vec<(usize, f64)>> {
    let to_deg = 1f64.to_degrees();
    let of_pose = [(0, 1.0), (1, 1.0), (2, to_deg)]
        .map(|(offset, unit)| pose_column(sweep).map(|at| (at + offset, unit)));
    let offset = |wall: &Segment| {
        let middle_m = posed.plan.lines[wall.line].along_m(wall.a.midpoint(wall.b));
        columns.of(wall.line).map_or_else(Vec::new, |at| vec![(at, middle_m), (at + 1, -1.0)])
    };
    let turn = |wall: &Segment| columns.of(wall.line).map(|at| (at, to_deg));
    let of_pose = of_pose.into_iter().map(|of| of.into_iter().collect());
    let turns = segments.iter().map(|wall| turn(wall).into_iter().collect());
    let of_posts = (columns.of_post(0)..columns.count()).map(|at| vec![(at, 1.0)]);
    of_pose.chain(segments.iter().map(offset)).chain(turns).chain(of_posts).collect()
}

/// Adds a gradient and an information matrix whose parameters depend linearly on columns.
fn add_mapped(
    normal: &mut NormalEquations,
    map: &[Vec<(usize, f64)>],
    gradient: &DVector<f64>,
    information: &DMatrix<f64>,
) {
    for (at, of) in map.iter().enumerate() {
        for &(row, unit) in of {
            normal.add_gradient(row, unit * gradient[at]);
            for (other, by) in map.iter().enumerate() {
                for &(column, by) in by {
                    normal.add_information(row, column, unit * by * information[(at, other)]);
                }
            }
        }
    }
}
