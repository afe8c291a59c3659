//! Relative poses by odometry, as a prior of consecutive poses.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::{DVec2, Pose, wrap_180, wrap_pi};

use crate::normal::NormalEquations;

/// Error model of odometry between consecutive sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OdometrySigma {
    /// Standard deviation of the position per metre driven, metres.
    pub m_per_m: f64,
    /// Standard deviation of the heading per metre driven, degrees.
    pub deg_per_m: f64,
    /// Standard deviation of the position at each stop in addition, metres.
    pub m_per_stop: f64,
    /// Standard deviation of the heading at each stop in addition, degrees.
    pub deg_per_stop: f64,
    /// Positions are waypoints in one frame, independent of the headings, rather than driven
    /// distances in the frame of the robot.
    pub are_waypoints: bool,
}

impl Default for OdometrySigma {
    fn default() -> Self {
        Self {
            m_per_m: 0.05,
            deg_per_m: 5.0,
            m_per_stop: 0.005,
            deg_per_stop: 0.5,
            are_waypoints: false,
        }
    }
}

/// Relative pose between consecutive sweeps by odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Move {
    /// Displacement, metres: in the frame of the first pose, or in that of the waypoints.
    by: DVec2,
    are_waypoints: bool,
    turned_deg: f64,
    pub(crate) sigma_m: f64,
    pub(crate) sigma_deg: f64,
}

impl Move {
    pub(crate) fn new(from: &Pose, to: &Pose, sigma: OdometrySigma) -> Self {
        let is_turned = !sigma.are_waypoints;
        let by = displacement(from, to.position(), is_turned);
        let driven_m = by.length();
        Self {
            by,
            are_waypoints: sigma.are_waypoints,
            turned_deg: wrap_180(to.heading_deg - from.heading_deg),
            sigma_m: sigma.m_per_m * driven_m + sigma.m_per_stop,
            sigma_deg: sigma.deg_per_m * driven_m + sigma.deg_per_stop,
        }
    }

    /// Moves between consecutive odometry poses.
    pub(crate) fn between(poses: &[Pose], sigma: OdometrySigma) -> Vec<Self> {
        poses.windows(2).map(|pair| Self::new(&pair[0], &pair[1], sigma)).collect()
    }

    /// Pose after the move.
    pub(crate) fn from(&self, pose: &Pose) -> Pose {
        let by = self.axis(pose).rotate(self.by);
        let heading_deg = wrap_180(pose.heading_deg + self.turned_deg);
        Pose { x_m: pose.x_m + by.x, y_m: pose.y_m + by.y, heading_deg }
    }

    /// First axis of the frame of displacements.
    fn axis(&self, from: &Pose) -> DVec2 {
        match self.are_waypoints {
            true => DVec2::X,
            false => DVec2::from_angle(from.heading_deg.to_radians()),
        }
    }

    /// Returns `true` if the direction of the move is known in the world instead of relative to the
    /// robot.
    pub(crate) const fn are_waypoints(&self) -> bool {
        self.are_waypoints
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
        let turned = displacement(from, to.position(), !self.are_waypoints);
        let axes = [DVec2::X, DVec2::Y].map(|axis| self.axis(from).rotate(axis));
        let by_heading = if self.are_waypoints { DVec2::ZERO } else { -turned.perp() };
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

/// Displacement from a pose to a point, in the frame of the pose if `is_turned`.
fn displacement(pose: &Pose, point: DVec2, is_turned: bool) -> DVec2 {
    if is_turned { pose.point_in_frame(point) } else { point - pose.position() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normal::move_pose;

    #[test]
    fn waypoints_are_independent_of_headings() {
        let sigma = OdometrySigma { are_waypoints: true, ..OdometrySigma::default() };
        let pose = |x_m, heading_deg| Pose { x_m, y_m: 0.5, heading_deg };
        let moved = Move::new(&pose(0.0, 10.0), &pose(1.0, 20.0), sigma);
        // Both turned by 40 degrees.
        let [from, to] = [pose(0.0, 50.0), pose(1.0, 60.0)];
        assert!(moved.loss(&from, &to) < 1e-12);
        assert!((moved.from(&from).x_m - 1.0).abs() < 1e-12);
        let driven = Move::new(&pose(0.0, 10.0), &pose(1.0, 20.0), OdometrySigma::default());
        assert!(driven.loss(&from, &to) > 10.0);
    }

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
