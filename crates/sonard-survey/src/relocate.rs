//! Sweeps whose poses the course got wrong, located in the plan of the others.

use std::sync::Arc;

use sonard_inverse::{CoarseGrid, locate};
use sonard_model::geometry::Pose;

use crate::{
    judge::Judge, odometry::in_frame_of_first, posed::PosedPlan, symmetry::pose_score,
    trace::unexplained,
};

/// Minimum gain of another pose, nats.
const MIN_GAIN: f64 = 10.0;
/// Maximum share of sweeps that may be lost: the plan is that of the others.
const MAX_LOST: f64 = 0.5;

/// Poses with those of lost sweeps replaced, in the frame of the first sweep; `None` if no sweep has
/// a better one.
pub(crate) fn relocated(posed: &PosedPlan, judge: &Judge) -> Option<Vec<Pose>> {
    let workspace = judge.workspace;
    if workspace.is_array {
        // Odometry leaves few sweeps of a moving array lost, and `locate` takes those of a stepper.
        return None;
    }
    let segments = posed.plan.segments(&posed.walls);
    let (simulator, predictions) = judge.predictions(&segments)?;
    let left = unexplained(workspace, &predictions);
    let lost_share = workspace.max_unexplained_share();
    let is_lost = |sweep: &usize| {
        let of_sweep = left.iter().filter(|arc| arc.sweep == *sweep).count();
        of_sweep as f64 > lost_share * workspace.arcs[*sweep].len() as f64
    };
    let lost: Vec<usize> = (0..posed.poses.len()).filter(is_lost).collect();
    if lost.is_empty() || lost.len() as f64 > MAX_LOST * posed.poses.len() as f64 {
        return None;
    }
    let mut world = workspace.world.clone();
    world.scene = Arc::new(judge.scene_of(&segments));
    let grid = CoarseGrid::new(&world, CoarseGrid::default_spacing_m(&world.scene)).ok()?;
    let mut poses = posed.poses.clone();
    let mut is_changed = false;
    for sweep in lost {
        let score = |pose: &Pose| pose_score(posed, judge, &simulator, sweep, pose);
        let modes = locate(&world, &grid, &workspace.sweeps[sweep]).unwrap_or_default();
        let scored = modes.iter().filter_map(|mode| {
            let pose = mode.pose();
            Some((score(&pose)?, pose))
        });
        let best = scored.max_by(|a, b| a.0.total_cmp(&b.0));
        if let (Some((nats, pose)), Some(own)) = (best, score(&posed.poses[sweep]))
            && nats > own + MIN_GAIN
        {
            poses[sweep] = pose;
            is_changed = true;
        }
    }
    is_changed.then(|| in_frame_of_first(&poses, &posed.poses[0]))
}
