//! Relative poses by odometry, as a prior of consecutive poses.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::{DVec2, Pose, wrap_180, wrap_pi};

use crate::normal::NormalEquations;

/// Error model of odometry between consecutive sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OdometrySigma {
    /// Standard deviation of the position per metre driven, metres.
    pub m_per_m: f64,
    /// Standard deviation of the heading per metre driven, degrees.
    pub deg_per_m: f64,
}

impl Default for OdometrySigma {
    fn default() -> Self {
        Self { m_per_m: 0.05, deg_per_m: 5.0 }
    }
}

/// Standard deviations in addition to those per metre driven, metres and degrees.
const MIN_SIGMA: (f64, f64) = (0.005, 0.5);

/// Relative pose between consecutive sweeps by odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Move {
    /// Displacement in the frame of the first pose, metres.
    by: DVec2,
    turned_deg: f64,
    pub(crate) sigma_m: f64,
    pub(crate) sigma_deg: f64,
}

impl Move {
    pub(crate) fn new(from: &Pose, to: &Pose, sigma: OdometrySigma) -> Self {
        let by = in_frame(from, to.position());
        let driven_m = by.length();
        Self {
            by,
            turned_deg: wrap_180(to.heading_deg - from.heading_deg),
            sigma_m: sigma.m_per_m * driven_m + MIN_SIGMA.0,
            sigma_deg: sigma.deg_per_m * driven_m + MIN_SIGMA.1,
        }
    }

    /// Moves between consecutive odometry poses.
    pub(crate) fn between(poses: &[Pose], sigma: OdometrySigma) -> Vec<Self> {
        poses.windows(2).map(|pair| Self::new(&pair[0], &pair[1], sigma)).collect()
    }

    /// Pose after the move.
    pub(crate) fn from(&self, pose: &Pose) -> Pose {
        let by = DVec2::from_angle(pose.heading_deg.to_radians()).rotate(self.by);
        let heading_deg = wrap_180(pose.heading_deg + self.turned_deg);
        Pose { x_m: pose.x_m + by.x, y_m: pose.y_m + by.y, heading_deg }
    }

    /// Negative log-density of a pair of poses relative to that of the likeliest pair, nats.
    pub(crate) fn loss(&self, from: &Pose, to: &Pose) -> f64 {
        let mut normal = NormalEquations::new(0);
        self.add_to(&mut normal, [from, to], [None, None]);
        normal.loss()
    }

    /// Adds the residuals of the move; `columns` are those of x of the two poses, followed by y and
    /// heading in radians, `None` for a fixed pose.
    pub(crate) fn add_to(
        &self,
        normal: &mut NormalEquations,
        [from, to]: [&Pose; 2],
        [of_from, of_to]: [Option<usize>; 2],
    ) {
        /// Odometry is not robust: its errors are its only bound.
        const NORMAL: f64 = 1e3;
        let turned = in_frame(from, to.position());
        let axes = [DVec2::X, DVec2::Y]
            .map(|axis| DVec2::from_angle(from.heading_deg.to_radians()).rotate(axis));
        let by_heading = -turned.perp();
        for (axis, (unit, by_rad)) in axes.iter().zip(by_heading.to_array()).enumerate() {
            let mut row = Vec::with_capacity(5);
            if let Some(at) = of_from {
                row.extend([(at, -unit.x), (at + 1, -unit.y), (at + 2, by_rad)]);
            }
            if let Some(at) = of_to {
                row.extend([(at, unit.x), (at + 1, unit.y)]);
            }
            normal.add(&row, self.by[axis] - turned[axis], self.sigma_m, NORMAL);
        }
        let mut row = Vec::with_capacity(2);
        row.extend(of_from.map(|at| (at + 2, -1.0)));
        row.extend(of_to.map(|at| (at + 2, 1.0)));
        let off_deg = self.turned_deg - (to.heading_deg - from.heading_deg);
        normal.add(&row, wrap_pi(off_deg.to_radians()), self.sigma_deg.to_radians(), NORMAL);
    }
}

/// Poses moved together so that the first is `start`.
pub(crate) fn in_frame_of_first(poses: &[Pose], start: &Pose) -> Vec<Pose> {
    let Some(first) = poses.first().filter(|first| *first != start) else { return poses.to_vec() };
    let to = |pose: &Pose| Move::new(first, pose, OdometrySigma::default()).from(start);
    poses.iter().map(to).collect()
}

fn in_frame(pose: &Pose, point: DVec2) -> DVec2 {
    DVec2::from_angle(-pose.heading_deg.to_radians()).rotate(point - pose.position())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normal::move_pose;

    #[test]
    fn moves_lead_from_pose_to_pose() {
        let [a, b] = [
            Pose { x_m: 1.0, y_m: 0.5, heading_deg: 170.0 },
            Pose { x_m: 0.4, y_m: 0.9, heading_deg: -160.0 },
        ];
        let moved = Move::new(&a, &b, OdometrySigma::default());
        let found = moved.from(&a);
        assert!(found.position().distance(b.position()) < 1e-12);
        assert!((found.heading_deg - b.heading_deg).abs() < 1e-12);
        // From any disturbed pair one step of Gauss and Newton leads back, except for second order.
        let off = Pose { x_m: b.x_m + 0.002, y_m: b.y_m - 0.001, heading_deg: -160.2 };
        let mut normal = NormalEquations::new(3);
        moved.add_to(&mut normal, [&a, &off], [None, Some(0)]);
        let step = normal.step(0.0).expect("determined");
        assert!((step[0] + 0.002).abs() < 1e-6 && (step[1] - 0.001).abs() < 1e-6, "{step}");
        assert!((step[2] - 0.2_f64.to_radians()).abs() < 1e-6, "{step}");
        // Moved instead, the first pose takes the residuals, too.
        let mut normal = NormalEquations::new(3);
        moved.add_to(&mut normal, [&a, &off], [Some(0), None]);
        let before = normal.loss();
        let step = normal.step(0.0).expect("determined");
        let mut moved_a = a;
        move_pose(&mut moved_a, [step[0], step[1], step[2]]);
        let mut normal = NormalEquations::new(3);
        moved.add_to(&mut normal, [&moved_a, &off], [Some(0), None]);
        assert!(normal.loss() < 1e-3 * before, "{} {before}", normal.loss());
    }
}
