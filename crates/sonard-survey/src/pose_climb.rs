//! Maximum of the likelihood over the poses in a fixed plan.

use rayon::prelude::*;
use sonard_inverse::{ErrorModel, Hypotheses, Parameter};
use sonard_model::geometry::Pose;

use crate::{
    normal::{NormalEquations, move_pose},
    odometry::Move,
    workspace::Workspace,
};

/// Likelihood of the readings as a function of the pose of one sweep, in a fixed plan.
///
/// Given the plan, sweeps depend on each other by odometry alone. A step of all numbers together is
/// limited by the pose that gains least: where an arc ends or an echo vanishes, the likelihood is far
/// from the parabola that such a step assumes.
pub(crate) struct PoseClimb<'a> {
    workspace: &'a Workspace<'a>,
    hypotheses: &'a Hypotheses,
    errors: &'a ErrorModel,
}

impl<'a> PoseClimb<'a> {
    /// Parameters that the evaluator of the likelihood must have.
    pub(crate) const PARAMETERS: [Parameter; 3] =
        [Parameter::X(0), Parameter::Y(0), Parameter::Heading(0)];

    pub(crate) const fn new(
        workspace: &'a Workspace<'a>,
        hypotheses: &'a Hypotheses,
        errors: &'a ErrorModel,
    ) -> Self {
        Self { workspace, hypotheses, errors }
    }

    /// Improves the poses, first those of even number, then those between. The first pose stays if
    /// odometry gives directions in the world, since they refer to its frame.
    pub(crate) fn improve(&self, poses: &mut [Pose]) {
        let first = usize::from(self.workspace.moves.iter().any(Move::are_waypoints));
        for parity in [0, 1] {
            let fixed: &[Pose] = poses;
            let of_parity = (first..fixed.len()).into_par_iter().filter(|at| at % 2 == parity);
            let improved: Vec<(usize, Pose)> =
                of_parity.filter_map(|at| Some((at, self.improved(at, fixed)?))).collect();
            for (at, pose) in improved {
                poses[at] = pose;
            }
        }
    }

    /// Likeliest pose of a sweep near its own, between neighbours that stay; `None` if none is
    /// likelier.
    fn improved(&self, sweep: usize, poses: &[Pose]) -> Option<Pose> {
        const MAX_STEPS: usize = 8;
        /// Expected gain below which no further step is made, nats.
        const MIN_GAIN: f64 = 0.005;
        let start = poses[sweep];
        let mut pose = start;
        let (mut value, mut normal) = self.linearize(sweep, pose, poses)?;
        let mut damping = 1e-3;
        for _ in 0..MAX_STEPS {
            let step = normal.step(damping)?;
            if normal.expected_gain(&step) < MIN_GAIN {
                break;
            }
            let mut tried = pose;
            move_pose(&mut tried, [step[0], step[1], step[2]]);
            let (at, equations) = self.linearize(sweep, tried, poses)?;
            if at > value {
                (pose, value, normal, damping) = (tried, at, equations, 0.1 * damping);
            } else {
                damping *= 10.0;
            }
        }
        (pose != start).then_some(pose)
    }

    /// Log-likelihood of a sweep and its moves, with normal equations of its pose.
    fn linearize(
        &self,
        sweep: usize,
        pose: Pose,
        poses: &[Pose],
    ) -> Option<(f64, NormalEquations)> {
        let mut normal = NormalEquations::new(3);
        let mut value = 0.0;
        for viewpoint in self.workspace.viewpoints.iter().filter(|of| of.sweep == sweep) {
            let at = viewpoint.pose(&pose);
            let likelihood =
                self.hypotheses.log_likelihood(&viewpoint.beams, &at, self.errors).ok()?;
            value += likelihood.value;
            normal.add_likelihood(&viewpoint.pose_columns(&pose, Some(0)), &likelihood);
        }
        let moves = &self.workspace.moves;
        if let Some((step, last)) =
            sweep.checked_sub(1).and_then(|at| moves.get(at).zip(poses.get(at)))
        {
            value -= step.loss(last, &pose);
            step.add_to(&mut normal, [last, &pose], [None, Some(0)]);
        }
        if let Some((step, next)) = moves.get(sweep).zip(poses.get(sweep + 1)) {
            value -= step.loss(&pose, next);
            step.add_to(&mut normal, [&pose, next], [Some(0), None]);
        }
        Some((value, normal))
    }
}
