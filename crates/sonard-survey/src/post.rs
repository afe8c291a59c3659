//! Post of a plan.

use sonard_model::geometry::{DVec2, distance_to_segment};

use crate::arrangement::Segment;

/// Limits of the radius of a post, metres.
const RADIUS_M: [f64; 2] = [0.004, 0.15];
/// Minimum distance from the surface of a post to a wall, metres.
pub(crate) const CLEAR_M: f64 = 0.01;

/// Upright cylinder of a plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PostShape {
    /// Axis, metres.
    pub center: DVec2,
    /// Radius, metres.
    pub radius_m: f64,
}

impl PostShape {
    /// Post moved by metres in x, y and radius, the radius within its limits.
    pub(crate) fn moved(&self, [x_m, y_m, by_m]: [f64; 3]) -> Self {
        let radius_m = (self.radius_m + by_m).clamp(RADIUS_M[0], RADIUS_M[1]);
        Self { center: self.center + DVec2::new(x_m, y_m), radius_m }
    }

    /// Returns `true` if no wall is inside or at the surface.
    pub(crate) fn is_clear_of(&self, walls: &[Segment]) -> bool {
        let clear_m = self.radius_m + CLEAR_M;
        walls.iter().all(|of| distance_to_segment(self.center, of.a, of.b) > clear_m)
    }
}
