//! Positions from which the beams of a sweep are fired.

use std::borrow::Cow;

use sonard_inverse::FitSweep;
use sonard_model::geometry::{DVec2, Pose};

/// Beams of a sweep that are fired from one position of the transducer.
pub(crate) struct Viewpoint<'a> {
    pub(crate) sweep: usize,
    /// Position in the frame of the sweep's pose, metres; zero on a stepper, where the sensor's
    /// mounting states it.
    pub(crate) face: DVec2,
    pub(crate) beams: Cow<'a, FitSweep>,
}

impl Viewpoint<'_> {
    /// Position (world, metres) and heading of the transducer, from the pose of the sweep.
    pub(crate) fn pose(&self, of_sweep: &Pose) -> Pose {
        let place = of_sweep.position() + of_sweep.rotate_to_world(self.face);
        Pose { x_m: place.x, y_m: place.y, ..*of_sweep }
    }

    /// For x, y and heading (degrees) of the transducer, the columns of the pose of the sweep (x, y and
    /// heading in radians, from column `at`) with the derivatives by them; without columns for a
    /// fixed pose.
    pub(crate) fn pose_columns(
        &self,
        of_sweep: &Pose,
        at: Option<usize>,
    ) -> [Vec<(usize, f64)>; 3] {
        let Some(at) = at else { return Default::default() };
        let rate_m = self.turn_rate_m(of_sweep);
        [
            vec![(at, 1.0), (at + 2, rate_m.x)],
            vec![(at + 1, 1.0), (at + 2, rate_m.y)],
            vec![(at + 2, 1f64.to_degrees())],
        ]
    }

    /// Derivatives of the position by the heading of the sweep, metres per radian.
    fn turn_rate_m(&self, of_sweep: &Pose) -> DVec2 {
        of_sweep.rotate_to_world(self.face).perp()
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    #[test]
    fn turn_rate_is_the_derivative_of_the_position() {
        const STEP_RAD: f64 = 1e-5;
        let robot = Pose { x_m: 0.4, y_m: -0.7, heading_deg: 130.0 };
        let sweep = FitSweep { scan: Uuid::nil(), pose: robot, beams: Vec::new() };
        let face = DVec2::new(0.12, -0.09);
        let viewpoint = Viewpoint { sweep: 0, face, beams: Cow::Borrowed(&sweep) };
        let [before, after] = [-STEP_RAD, STEP_RAD].map(|by_rad| {
            let heading_deg = robot.heading_deg + by_rad.to_degrees();
            viewpoint.pose(&Pose { heading_deg, ..robot }).position()
        });
        let expected = (after - before) / (2.0 * STEP_RAD);
        assert!(viewpoint.turn_rate_m(&robot).distance(expected) < 1e-9);
        assert!(
            (viewpoint.pose(&robot).position().distance(robot.position()) - 0.15).abs() < 1e-12
        );
    }
}
