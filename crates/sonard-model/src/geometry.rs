//! Points, poses and angles. The world frame has x to the right and y up, in metres.

mod arrangement;
mod mirror;
mod outline;
mod sets;
mod snap;

pub use arrangement::{Arrangement, Piece, between};
pub use glam::DVec2;
pub use mirror::Mirror;
pub use outline::{enclosed_area, encloses};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub use snap::{Cause, End, Move, snap};

/// Position of the ranger's rotation axis and direction of azimuth 0.
///
/// On the command line a pose is written `X,Y,DEG`, in records `{"x_m","y_m","heading_deg"}`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
pub struct Pose {
    /// World x of the rotation axis, metres.
    pub x_m: f64,
    /// World y of the rotation axis, metres.
    pub y_m: f64,
    /// Direction of azimuth 0, degrees counter-clockwise from world +x.
    #[serde(default)]
    pub heading_deg: f64,
}

impl Pose {
    /// The position of the rotation axis.
    #[must_use]
    pub const fn position(&self) -> DVec2 {
        DVec2::new(self.x_m, self.y_m)
    }

    /// World direction (radians counter-clockwise from +x) of an azimuth in degrees.
    #[must_use]
    pub fn direction_rad(&self, azimuth_deg: f64) -> f64 {
        (self.heading_deg + azimuth_deg).to_radians()
    }

    /// The point at `range_m` along `azimuth_deg`.
    #[must_use]
    pub fn point_at(&self, azimuth_deg: f64, range_m: f64) -> DVec2 {
        self.position() + range_m * DVec2::from_angle(self.direction_rad(azimuth_deg))
    }
}

/// The angle from one direction to another, radians in [-pi, pi], counter-clockwise positive; the vectors' lengths
/// do not matter.
///
/// By the arc tangent, which is right to rounding: the arc cosine of a scalar product loses half of the digits where
/// the directions are nearly the same.
#[must_use]
pub fn turn_rad(from: DVec2, to: DVec2) -> f64 {
    from.perp_dot(to).atan2(from.dot(to))
}

/// Distance of a point from the segment `a`-`b`, metres.
#[must_use]
pub fn distance_to_segment(point: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let share = (point - a).dot(along) / along.length_squared();
    point.distance(a + share.clamp(0.0, 1.0) * along)
}

/// An angle in degrees brought into [0, 360).
#[must_use]
pub fn wrap_360(angle_deg: f64) -> f64 {
    let wrapped = angle_deg.rem_euclid(360.0);
    // rem_euclid of a tiny negative number rounds up to the modulus itself.
    if wrapped >= 360.0 { 0.0 } else { wrapped }
}

/// An angle in degrees brought into (-180, 180].
#[must_use]
pub fn wrap_180(angle_deg: f64) -> f64 {
    let wrapped = wrap_360(angle_deg);
    if wrapped > 180.0 { wrapped - 360.0 } else { wrapped }
}

/// An angle in radians brought into (-pi, pi].
#[must_use]
pub fn wrap_pi(angle_rad: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    // Nearly all are a turn off at most; the remainder of a division costs more than what they are for.
    if angle_rad.abs() < 3.0 * PI {
        return if angle_rad > PI {
            angle_rad - TAU
        } else if angle_rad <= -PI {
            angle_rad + TAU
        } else {
            angle_rad
        };
    }
    let wrapped = angle_rad.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrap_360_stays_below_the_modulus() {
        for (angle_deg, expected) in [(-0.9, 359.1), (360.0, 0.0), (-1e-17, 0.0), (725.0, 5.0)] {
            assert!((wrap_360(angle_deg) - expected).abs() < 1e-9, "{angle_deg}");
            assert!(wrap_360(angle_deg) < 360.0, "{angle_deg}");
        }
    }

    #[test]
    fn point_at_turns_counter_clockwise_from_the_heading() {
        let pose = Pose { x_m: 1.0, y_m: 2.0, heading_deg: 90.0 };
        let ahead = pose.point_at(0.0, 2.0);
        let left = pose.point_at(90.0, 2.0);
        assert!((ahead - DVec2::new(1.0, 4.0)).length() < 1e-12);
        assert!((left - DVec2::new(-1.0, 2.0)).length() < 1e-12);
    }
}
