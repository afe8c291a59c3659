//! Position and direction of a transducer at a firing.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    acoustics::Mounting,
    geometry::{DVec2, Pose, wrap_360},
};

/// Position and direction of a transducer at a firing, in world coordinates.
///
/// Ranges are half the path length, measured from the transducer's centre. Constructed only by
/// [`Mounting::viewpoint`], so that predictions, pictures and the live page agree.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Viewpoint {
    /// Centre of the face, or midpoint between transmitter and receiver: x, metres.
    pub x_m: f64,
    /// Centre of the face, or midpoint between transmitter and receiver: y, metres.
    pub y_m: f64,
    /// Height in a scene with heights, metres; `null` for the model's default.
    pub z_m: Option<f64>,
    /// Beam direction, degrees counter-clockwise from +x, in [0, 360).
    pub direction_deg: f64,
    /// Upward tilt of the beam, degrees.
    pub tilt_deg: f64,
    /// Distance between transmitter (on the left) and receiver, metres; 0 for a common transducer.
    pub separation_m: f64,
}

impl Viewpoint {
    /// Centre of the transducer, metres.
    #[must_use]
    pub fn position(&self) -> DVec2 {
        DVec2::new(self.x_m, self.y_m)
    }

    /// Beam direction, radians counter-clockwise from +x.
    #[must_use]
    pub fn direction_rad(&self) -> f64 {
        self.direction_deg.to_radians()
    }

    /// Positions of transmitter and receiver, metres.
    #[must_use]
    pub fn transducer_positions(&self) -> [DVec2; 2] {
        let left = DVec2::from_angle(self.direction_rad()).perp();
        [0.5, -0.5].map(|side| self.position() + side * self.separation_m * left)
    }

    /// Point on the beam axis at a range in metres.
    #[must_use]
    pub fn point_at(&self, range_m: f64) -> DVec2 {
        self.position() + range_m * DVec2::from_angle(self.direction_rad())
    }

    /// Centre of the transducer as a pose, with the beam direction as its heading.
    #[must_use]
    pub const fn pose(&self) -> Pose {
        Pose { x_m: self.x_m, y_m: self.y_m, heading_deg: self.direction_deg }
    }
}

impl Mounting {
    /// Viewpoint of the mounted transducer for a rotation axis at the position of `axis` and a beam
    /// at its heading.
    #[must_use]
    pub fn viewpoint(&self, axis: &Pose) -> Viewpoint {
        let direction_deg = wrap_360(axis.heading_deg);
        let [transmitter, receiver] =
            self.transducer_positions(axis.position(), direction_deg.to_radians());
        let [x_m, y_m] = (0.5 * (transmitter + receiver)).to_array();
        Viewpoint {
            x_m,
            y_m,
            z_m: self.z_m,
            direction_deg,
            tilt_deg: self.tilt_deg,
            separation_m: self.separation_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_face_rotates_with_axis() {
        let mounting =
            Mounting { ahead_m: 0.1, left_m: 0.02, separation_m: 0.026, ..Mounting::default() };
        for (heading_deg, middle) in
            [(0.0, [1.1, 2.02]), (90.0, [0.98, 2.1]), (-180.0, [0.9, 1.98]), (450.0, [0.98, 2.1])]
        {
            let axis = Pose { x_m: 1.0, y_m: 2.0, heading_deg };
            let viewpoint = mounting.viewpoint(&axis);
            assert!(viewpoint.position().distance(middle.into()) < 1e-12, "{heading_deg}");
            let places = mounting.transducer_positions(axis.position(), heading_deg.to_radians());
            for (end, place) in viewpoint.transducer_positions().into_iter().zip(places) {
                assert!(end.distance(place) < 1e-12, "{heading_deg}");
            }
            let ahead = viewpoint.point_at(2.0) - viewpoint.position();
            assert!((ahead - 2.0 * DVec2::from_angle(heading_deg.to_radians())).length() < 1e-12);
        }
    }
}
