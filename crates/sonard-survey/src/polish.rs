//! Final estimate of poses and walls by the exact likelihood of all readings.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sonard_inverse::{ErrorModel, Hypotheses, LogLikelihood, Parameter, PostPart};

use crate::{
    arc::{Arc, quantile},
    arrangement::Segment,
    covariance::PlanCovariance,
    judge::Judge,
    normal::{NormalEquations, pose_column},
    pose_climb::PoseClimb,
    posed::{LineColumns, PosedPlan},
    sensor_fit::FreeNumbers,
    trace::explain,
    viewpoint::Viewpoint,
};

/// Factor of the standard deviations by the information matrix. It assumes a parabola, while arcs end
/// and echoes vanish abruptly: of an array in simulated rooms its 95 % intervals hold 83 to 90 % of
/// the true poses, walls and corners, and 96 to 100 % with this factor.
const WIDENED: f64 = 1.3;
const MAX_STEPS: usize = 20;
/// Expected gain below which no further step is made, nats.
const MIN_GAIN: f64 = 0.005;
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
/// the ends of arcs. Directions are tied to a square axis if the survey assumes one. Returns the
/// covariance, or `None` if the normal equations have no solution.
pub(crate) fn polish(posed: &mut PosedPlan, judge: &Judge) -> Option<PlanCovariance> {
    let (polished, linear) = polish_with(posed, judge, FreeNumbers::none())?;
    *posed = polished.posed;
    let covariance = PlanCovariance::new(linear.normal.covariance()?, LineColumns::new(posed));
    Some(covariance.scaled(WIDENED * WIDENED))
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

/// Maximizes the likelihood under an error model, by steps of all numbers together; where none gains,
/// by those of single poses.
fn climb(estimate: &mut Estimate, judge: &Judge, errors: &ErrorModel) -> Option<Linearized> {
    let mut best = linearize(estimate, judge, errors)?;
    let improve_by = |best: &mut Linearized, tried: Estimate, estimate: &mut Estimate| {
        let at = linearize(&tried, judge, errors).filter(|at| at.value > best.value);
        at.map(|at| (*estimate, *best) = (tried, at)).is_some()
    };
    let mut damping = 1e-3;
    let mut are_poses_tried = false;
    for _ in 0..MAX_STEPS {
        let step = best.normal.step(damping)?;
        let may_gain = best.normal.expected_gain(&step) > MIN_GAIN;
        if may_gain {
            let tried = moved(estimate, &step, judge);
            if improve_by(&mut best, tried, estimate) {
                damping *= 0.1;
                are_poses_tried = false;
                continue;
            }
            damping *= 10.0;
        }
        if !are_poses_tried {
            are_poses_tried = true;
            if let Some(tried) = with_likelier_poses(estimate, judge, errors)?
                && improve_by(&mut best, tried, estimate)
            {
                continue;
            }
        }
        if !may_gain {
            break;
        }
    }
    Some(best)
}

/// Estimate after a step of its numbers.
fn moved(estimate: &Estimate, step: &DVector<f64>, judge: &Judge) -> Estimate {
    let columns = LineColumns::new(&estimate.posed);
    let of_numbers = &step.as_slice()[columns.count()..];
    Estimate {
        posed: estimate.posed.moved(&columns, step, judge.workspace.reach_m()),
        numbers: estimate.numbers.moved(of_numbers, &judge.workspace.world),
    }
}

/// Estimate with the likeliest poses in its plan, in the frame of its first pose; `Some(None)` if its
/// own are the likeliest.
fn with_likelier_poses(
    estimate: &Estimate,
    judge: &Judge,
    errors: &ErrorModel,
) -> Option<Option<Estimate>> {
    let in_plan = hypotheses(estimate, judge, PoseClimb::PARAMETERS.to_vec())?;
    let mut poses = estimate.posed.poses.clone();
    PoseClimb::new(judge.workspace, &in_plan, errors).improve(&mut poses);
    if poses == estimate.posed.poses {
        return Some(None);
    }
    let Estimate { posed, numbers } = estimate.clone();
    let frame = posed.poses[0];
    let posed = posed.with_poses(poses, judge.workspace.reach_m()).in_frame(&frame);
    Some(Some(Estimate { posed, numbers }))
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

/// Evaluator of the likelihood in the plan of an estimate.
fn hypotheses(
    Estimate { posed, numbers }: &Estimate,
    judge: &Judge,
    parameters: Vec<Parameter>,
) -> Option<Hypotheses> {
    let mut world = judge.workspace.world.clone();
    world.sensor.mounting.left_m = judge.workspace.left_m;
    let segments = posed.plan.segments(&posed.walls);
    world.scene = std::sync::Arc::new(judge.with_posts(&posed.posts).scene_of(&segments));
    Hypotheses::new(numbers.changed(&world)?, parameters).ok()
}

/// Predicts all sweeps with their derivatives.
fn linearize(estimate: &Estimate, judge: &Judge, errors: &ErrorModel) -> Option<Linearized> {
    let Estimate { posed, numbers } = estimate;
    let workspace = judge.workspace;
    let segments = posed.plan.segments(&posed.walls);
    let mut parameters = PoseClimb::PARAMETERS.to_vec();
    parameters.extend((0..segments.len()).map(Parameter::Wall));
    parameters.extend((0..segments.len()).map(Parameter::WallTurn));
    let parts = [PostPart::X, PostPart::Y, PostPart::Radius];
    let of_post = |post: usize| parts.map(|part| Parameter::Post(post, part));
    parameters.extend((0..posed.posts.len()).flat_map(of_post));
    parameters.extend(numbers.parameters());
    let hypotheses = hypotheses(estimate, judge, parameters)?;
    let of_viewpoint = |viewpoint: &Viewpoint| {
        let pose = viewpoint.pose(&posed.poses[viewpoint.sweep]);
        hypotheses.log_likelihood(&viewpoint.beams, &pose, errors).ok()
    };
    let viewpoints = workspace.viewpoints.par_iter();
    let all: Option<Vec<LogLikelihood>> = viewpoints.map(of_viewpoint).collect();
    let columns = LineColumns::new(posed);
    let mut normal = NormalEquations::new(columns.count() + numbers.count());
    let mut value = 0.0;
    for (viewpoint, likelihood) in workspace.viewpoints.iter().zip(&all?) {
        value += likelihood.value;
        let mut map = parameter_columns(posed, &segments, &columns, viewpoint);
        map.extend((0..numbers.count()).map(|at| vec![(columns.count() + at, 1.0)]));
        normal.add_likelihood(&map, likelihood);
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

/// Derivatives of the parameters of a viewpoint (its pose, the offsets of all walls, their turns, the
/// posts) by columns of the normal equations.
///
/// Headings and turns are in degrees there and in radians here. The normal of a wall points to its
/// left, against that of its line, and a wall turns about its middle, a line about the foot of the
/// origin.
fn parameter_columns(
    posed: &PosedPlan,
    segments: &[Segment],
    columns: &LineColumns,
    viewpoint: &Viewpoint,
) -> Vec<Vec<(usize, f64)>> {
    let to_deg = 1f64.to_degrees();
    let of_pose =
        viewpoint.pose_columns(&posed.poses[viewpoint.sweep], pose_column(viewpoint.sweep));
    let offset = |wall: &Segment| {
        let middle_m = posed.plan.lines[wall.line].along_m(wall.a.midpoint(wall.b));
        columns.of(wall.line).map_or_else(Vec::new, |at| vec![(at, middle_m), (at + 1, -1.0)])
    };
    let turn = |wall: &Segment| columns.of(wall.line).map(|at| (at, to_deg));
    let turns = segments.iter().map(|wall| turn(wall).into_iter().collect());
    let of_posts = (columns.of_post(0)..columns.count()).map(|at| vec![(at, 1.0)]);
    of_pose.into_iter().chain(segments.iter().map(offset)).chain(turns).chain(of_posts).collect()
}
