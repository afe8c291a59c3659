//! Poses that explain a sweep as well as the one found because the room looks alike from them.

use sonard_model::{
    geometry::{DVec2, Pose, wrap_180},
    model::Simulator,
};

use crate::{alternatives::LISTED_NATS, arrangement::Segment, judge::Judge, posed::PosedPlan};

/// Maximum difference of the lengths of walls that a motion lays on each other, metres.
const SAME_LENGTH_M: f64 = 0.02;
/// Motions and poses closer than this are one: metres, degrees.
const SAME: (f64, f64) = (0.02, 1.0);

/// Rotation of the plane with a displacement.
#[derive(Debug, Clone, Copy)]
struct Motion {
    turn: DVec2,
    by: DVec2,
}

impl Motion {
    /// Motion that lays the middle and the direction of a segment on those of another.
    fn between([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> Self {
        let [from, to] = [b - a, d - c].map(DVec2::normalize_or_zero);
        let turn = DVec2::new(from.dot(to), from.perp_dot(to));
        Self { turn, by: c.midpoint(d) - turn.rotate(a.midpoint(b)) }
    }

    fn of(&self, pose: &Pose) -> Pose {
        let at = self.turn.rotate(pose.position()) + self.by;
        let heading_deg = wrap_180(pose.heading_deg + self.turn.to_angle().to_degrees());
        Pose { x_m: at.x, y_m: at.y, heading_deg }
    }
}

/// Other poses of each sweep within 10 nats, odometry included, by the motions that lay the longest
/// wall on a wall of equal length. The first pose is the frame and has none.
pub(crate) fn equivalent_poses(posed: &PosedPlan, judge: &Judge) -> Vec<Vec<Pose>> {
    let segments = posed.plan.segments(&posed.walls);
    let none = || vec![Vec::new(); posed.poses.len()];
    let Some(simulator) = judge.simulator_of(&segments) else { return none() };
    let motions = motions(&segments);
    let mut found = none();
    for (sweep, pose) in posed.poses.iter().enumerate().skip(1) {
        let score = |pose: &Pose| pose_score(posed, judge, &simulator, sweep, pose);
        let Some(own) = score(pose) else { continue };
        for other in motions.iter().map(|motion| motion.of(pose)) {
            let is_new =
                [pose].into_iter().chain(&found[sweep]).all(|known| !is_same(known, &other));
            if is_new && score(&other).is_some_and(|other| other > own - LISTED_NATS) {
                found[sweep].push(other);
            }
        }
    }
    found
}

fn motions(segments: &[Segment]) -> Vec<Motion> {
    let longest = segments.iter().max_by(|a, b| a.length_m().total_cmp(&b.length_m()));
    let Some(longest) = longest else { return Vec::new() };
    let is_equal = |of: &&Segment| (of.length_m() - longest.length_m()).abs() < SAME_LENGTH_M;
    let equal = segments.iter().filter(is_equal);
    let both = equal.flat_map(|of| [[of.a, of.b], [of.b, of.a]]);
    both.map(|ends| Motion::between([longest.a, longest.b], ends)).collect()
}

/// Log-likelihood of a sweep's readings and of the moves to and from it with another pose, nats;
/// `None` if the scene has more paths than the model follows.
pub(crate) fn pose_score(
    posed: &PosedPlan,
    judge: &Judge,
    simulator: &Simulator,
    sweep: usize,
    pose: &Pose,
) -> Option<f64> {
    let readings = judge.log_likelihood_of(simulator, sweep, pose)?;
    Some(readings - odometry_loss(posed, judge, sweep, pose))
}

/// Negative log-density of the moves to and from a sweep with another pose, nats.
fn odometry_loss(posed: &PosedPlan, judge: &Judge, sweep: usize, pose: &Pose) -> f64 {
    let moves = &judge.workspace.moves;
    let before = sweep.checked_sub(1).and_then(|from| Some((moves.get(from)?, &posed.poses[from])));
    let before = before.map(|(step, from)| step.loss(from, pose));
    let after = moves.get(sweep).zip(posed.poses.get(sweep + 1));
    let after = after.map(|(step, next)| step.loss(pose, next));
    before.unwrap_or(0.0) + after.unwrap_or(0.0)
}

fn is_same(a: &Pose, b: &Pose) -> bool {
    a.position().distance(b.position()) < SAME.0
        && wrap_180(a.heading_deg - b.heading_deg).abs() < SAME.1
}
