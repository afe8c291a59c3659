//! Poses by the likelihood of all readings, on grids around poses that are roughly known.

use rayon::prelude::*;
use sonard_model::geometry::{Pose, wrap_180};

use crate::{judge::Judge, posed::PosedPlan, symmetry::pose_score};

/// Number of steps of position along each axis, and of heading.
const STEPS: [usize; 2] = [5, 13];
/// Parts of the spans, of position and heading, of each level.
const LEVELS: [[f64; 2]; 2] = [[1.0, 1.0], [0.3, 0.25]];

/// Moves each sweep but the first to the pose within spans, metres and degrees, at which its
/// readings and odometry are likeliest, others unchanged.
///
/// Middles of wide arcs that nearer echoes cut are biased; the likelihood of all beams is not.
pub(crate) fn improve_poses(posed: &mut PosedPlan, judge: &Judge, [span_m, span_deg]: [f64; 2]) {
    let segments = posed.plan.segments(&posed.walls);
    let Some(simulator) = judge.simulator_of(&segments) else { return };
    for sweep in 1..posed.poses.len() {
        for [of_m, of_deg] in LEVELS {
            let center = posed.poses[sweep];
            let [places, headings] = STEPS;
            let pose = |at: usize| {
                let [x, y] = [at % places, at / places % places].map(|at| offset(at, places));
                let turn = offset(at / (places * places), headings);
                Pose {
                    x_m: center.x_m + of_m * span_m * x,
                    y_m: center.y_m + of_m * span_m * y,
                    heading_deg: wrap_180(center.heading_deg + of_deg * span_deg * turn),
                }
            };
            let scores: Vec<Option<f64>> = (0..places * places * headings)
                .into_par_iter()
                .map(|at| pose_score(posed, judge, &simulator, sweep, &pose(at)))
                .collect();
            let best = scores
                .iter()
                .enumerate()
                .filter_map(|(at, score)| Some((at, (*score)?)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((at, _)) = best {
                posed.poses[sweep] = pose(at);
            }
        }
    }
    let mut lines = posed.plan.lines.clone();
    lines.iter_mut().for_each(|line| line.update_feet(&posed.poses));
    (posed.plan, posed.walls) =
        posed.plan.rebuilt(&posed.walls, lines, &posed.poses, judge.workspace.reach_m());
}

/// Offset of a step, -1 to 1.
fn offset(at: usize, count: usize) -> f64 {
    2.0 * at as f64 / (count - 1) as f64 - 1.0
}
