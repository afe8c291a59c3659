//! Points, poses and angles. In the world frame x points right and y up, in metres.

mod arrangement;
mod mirror;
mod outline;
mod snap;
mod union_find;

pub use arrangement::{Arrangement, SegmentPiece, edge_key};
pub use glam::DVec2;
pub use mirror::Mirror;
pub use outline::{enclosed_area, encloses};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub use snap::{SegmentEnd, SnapCause, SnapMove, snap};

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
    /// Position of the rotation axis.
    #[must_use]
    pub const fn position(&self) -> DVec2 {
        DVec2::new(self.x_m, self.y_m)
    }

    /// World direction of an azimuth in degrees, radians counter-clockwise from +x.
    #[must_use]
    pub fn direction_rad(&self, azimuth_deg: f64) -> f64 {
        (self.heading_deg + azimuth_deg).to_radians()
    }

    /// Point at `range_m` along `azimuth_deg`.
    #[must_use]
    pub fn point_at(&self, azimuth_deg: f64, range_m: f64) -> DVec2 {
        self.position() + range_m * DVec2::from_angle(self.direction_rad(azimuth_deg))
    }

    /// Vector of the frame of the pose (x ahead, y to the left) along the axes of the world.
    #[must_use]
    pub fn rotate_to_world(&self, vector: DVec2) -> DVec2 {
        DVec2::from_angle(self.heading_deg.to_radians()).rotate(vector)
    }

    /// Point of the world in the frame of the pose (x ahead, y to the left), metres.
    #[must_use]
    pub fn point_in_frame(&self, point: DVec2) -> DVec2 {
        DVec2::from_angle(-self.heading_deg.to_radians()).rotate(point - self.position())
    }
}

/// Signed angle from one direction to another, radians in [-pi, pi], counter-clockwise positive.
/// The lengths of the vectors are irrelevant.
///
/// Uses the arc tangent, which is accurate to rounding. The arc cosine of a dot product loses half
/// of the digits for nearly equal directions.
#[must_use]
pub fn signed_angle_rad(from: DVec2, to: DVec2) -> f64 {
    from.perp_dot(to).atan2(from.dot(to))
}

/// Distance of a point from the segment `a`-`b`, metres.
#[must_use]
pub fn distance_to_segment(point: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let share = (point - a).dot(along) / along.length_squared();
    point.distance(a + share.clamp(0.0, 1.0) * along)
}

/// Wraps an angle in degrees to [0, 360).
#[must_use]
pub fn wrap_360(angle_deg: f64) -> f64 {
    let wrapped = angle_deg.rem_euclid(360.0);
    // rem_euclid of a tiny negative number rounds up to the modulus itself.
    if wrapped >= 360.0 { 0.0 } else { wrapped }
}

/// Wraps an angle in degrees to (-180, 180].
#[must_use]
pub fn wrap_180(angle_deg: f64) -> f64 {
    let wrapped = wrap_360(angle_deg);
    if wrapped > 180.0 { wrapped - 360.0 } else { wrapped }
}

/// Wraps an angle in radians to (-pi, pi].
#[must_use]
pub fn wrap_pi(angle_rad: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    // Fast path: nearly all angles are off by one turn at most, and a division is expensive here.
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
    fn wrap_360_is_below_360() {
        for (angle_deg, expected) in [(-0.9, 359.1), (360.0, 0.0), (-1e-17, 0.0), (725.0, 5.0)] {
            assert!((wrap_360(angle_deg) - expected).abs() < 1e-9, "{angle_deg}");
            assert!(wrap_360(angle_deg) < 360.0, "{angle_deg}");
        }
    }

    #[test]
    fn azimuth_is_counter_clockwise() {
        let pose = Pose { x_m: 1.0, y_m: 2.0, heading_deg: 90.0 };
        let ahead = pose.point_at(0.0, 2.0);
        let left = pose.point_at(90.0, 2.0);
        assert!((ahead - DVec2::new(1.0, 4.0)).length() < 1e-12);
        assert!((left - DVec2::new(-1.0, 2.0)).length() < 1e-12);
    }
}
