//! Directions of departure of a half-path.

use crate::geometry::{DVec2, signed_angle_rad, wrap_pi};

/// Interval of directions in which the rays of a half-path leave.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Departures {
    pub(crate) middle_rad: f64,
    pub(crate) half_rad: f64,
}

impl Departures {
    pub(crate) fn between(a: DVec2, b: DVec2) -> Self {
        let half_rad = 0.5 * signed_angle_rad(a, b);
        Self { middle_rad: wrap_pi(a.to_angle() + half_rad), half_rad: half_rad.abs() }
    }

    /// Smallest angle between directions of both intervals, radians.
    pub(crate) fn gap_rad(&self, other: &Self) -> f64 {
        let apart = wrap_pi(self.middle_rad - other.middle_rad).abs();
        (apart - self.half_rad - other.half_rad).max(0.0)
    }
}
