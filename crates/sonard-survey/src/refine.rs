//! Joint estimate of poses, lines and posts from the arcs that a plan explains, of any order.

use sonard_model::geometry::wrap_180;

use crate::{
    covariance::PlanCovariance,
    judge::Judge,
    normal::{NormalEquations, pose_column},
    posed::{LineColumns, PosedPlan},
    rows::RowBuilder,
    trace::{explain, predicted_arcs},
};

/// Share of the beams of an arc that must agree.
const SHARE: f64 = 0.4;
/// Prior standard deviations of a step: position and distance in metres, angle of a line and
/// heading in radians.
const PRIOR: [f64; 3] = [0.1, 0.052, 0.087];
/// Maximum change of a step in the same order.
const MAX_STEP: [f64; 3] = [0.02, 0.017, 0.026];

/// Improves poses, lines and posts together as far as the likelihood gains, and returns the
/// covariance.
/// Ranges that differ by more than `gate_m` do not belong together.
pub(crate) fn refine(
    posed: &mut PosedPlan,
    judge: &Judge,
    gate_m: f64,
    steps: usize,
) -> Option<PlanCovariance> {
    const SHARES: [f64; 3] = [1.0, 0.5, 0.2];
    // From the judge's poses: a coarse ranger's may have moved since, by less than lines and poses
    // together can gain later.
    let own = judge.with_posts(&posed.posts);
    let mut best = own.score_segments(&posed.plan.segments(&posed.walls));
    for _ in 0..2 {
        let mut far = posed.clone();
        for _ in 0..steps {
            if step(&mut far, judge, gate_m).is_none() {
                break;
            }
        }
        let mut is_better = false;
        for share in SHARES {
            let tried = between(posed, &far, share, judge.workspace.reach_m());
            let own = judge.at(&tried);
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
    let normal = equations(posed, &columns, judge, gate_m)?;
    let covariance = PlanCovariance::new(normal.covariance()?, columns);
    Some(covariance.scaled(judge.workspace.bias_factor().powi(2)))
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
    let mut posts = from.posts.clone();
    for (post, far) in posts.iter_mut().zip(&to.posts) {
        let by = share * (far.center - post.center);
        *post = post.moved([by.x, by.y, share * (far.radius_m - post.radius_m)]);
    }
    PosedPlan { plan, walls, posts, poses }
}

/// Makes a step of Gauss and Newton.
fn step(posed: &mut PosedPlan, judge: &Judge, gate_m: f64) -> Option<()> {
    let columns = LineColumns::new(posed);
    let mut normal = equations(posed, &columns, judge, gate_m)?;
    for pose in 1..posed.poses.len() {
        let at = pose_column(pose)?;
        normal.hold(at, PRIOR[0]);
        normal.hold(at + 1, PRIOR[0]);
        normal.hold(at + 2, PRIOR[2]);
    }
    for at in columns.iter() {
        normal.hold(at, PRIOR[1]);
        normal.hold(at + 1, PRIOR[0]);
    }
    for post in 0..posed.posts.len() {
        (0..3).for_each(|offset| normal.hold(columns.of_post(post) + offset, PRIOR[0]));
    }
    let step = normal.step(0.0)?;
    let mut excess: f64 = 1.0;
    let of_poses = 3 * (posed.poses.len() - 1);
    let first_post = columns.of_post(0);
    for (at, by) in step.iter().enumerate() {
        let max = match (at < of_poses, at % 3, (at.max(of_poses) - of_poses) % 2) {
            (true, 2, _) => MAX_STEP[2],
            (true, ..) | (false, _, 1) => MAX_STEP[0],
            (false, ..) if at >= first_post => MAX_STEP[0],
            (false, ..) => MAX_STEP[1],
        };
        excess = excess.max(by.abs() / max);
    }
    let step = step / excess;
    *posed = posed.moved(&columns, &step, judge.workspace.reach_m());
    Some(())
}

/// Normal equations of all explained arcs, odometry and squareness.
fn equations(
    posed: &PosedPlan,
    columns: &LineColumns,
    judge: &Judge,
    gate_m: f64,
) -> Option<NormalEquations> {
    let own = judge.at(posed);
    let (simulator, predictions) = own.predictions(&posed.plan.segments(&posed.walls))?;
    let runs = posed.plan.runs(&posed.walls);
    let rows = RowBuilder::new(posed, columns, (&simulator, judge.workspace.errors), &runs);
    let mut normal = NormalEquations::new(columns.count());
    for (sweep, arcs) in judge.workspace.arcs.iter().enumerate() {
        let (readings, predictions) = (&judge.readings()[sweep], &predictions[sweep]);
        let predicted = predicted_arcs(sweep, readings, predictions, judge.workspace.errors);
        for arc in arcs {
            let explained = explain(arc, readings, predictions, gate_m, SHARE);
            if let Some(explained) = explained.filter(|of| of.beams.len() >= 2.min(arc.beams.len()))
            {
                let errors = explained.range_errors_m(readings, predictions);
                rows.add_arc(&mut normal, &explained, errors, &predicted, gate_m);
            }
        }
    }
    for (at, step) in judge.workspace.moves.iter().enumerate() {
        if let [from, to, ..] = &posed.poses[at..] {
            step.add_to(&mut normal, [from, to], [pose_column(at), pose_column(at + 1)]);
        }
    }
    if let Some(sigma_rad) = judge.workspace.square_rad {
        columns.add_square(&mut normal, &posed.plan, sigma_rad);
    }
    Some(normal)
}
