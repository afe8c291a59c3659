//! Where a transducer is when it fires, and where it points.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    acoustics::Mounting,
    geometry::{DVec2, Pose, wrap_360},
};

/// Place and direction of a transducer at the moment of a firing, in the world.
///
/// Ranges count from its middle: half the length of a path. Made by [`Mounting::viewpoint`] and by nothing
/// else, so that predictions, pictures and the live page agree on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Viewpoint {
    /// Middle of the face, or between transmitter and receiver, metres.
    pub x_m: f64,
    /// The same along y, metres.
    pub y_m: f64,
    /// Its height in a scene with heights, metres; `null` for the model's usual one.
    pub z_m: Option<f64>,
    /// Where it points, degrees counter-clockwise from +x, in [0, 360).
    pub direction_deg: f64,
    /// How far up it points, degrees.
    pub tilt_deg: f64,
    /// Distance of the transmitter (on the left) from the receiver, metres; 0 for one transducer that is
    /// both.
    pub separation_m: f64,
}

impl Viewpoint {
    /// The middle, metres.
    #[must_use]
    pub fn position(&self) -> DVec2 {
        DVec2::new(self.x_m, self.y_m)
    }

    /// Where it points, radians counter-clockwise from +x.
    #[must_use]
    pub fn direction_rad(&self) -> f64 {
        self.direction_deg.to_radians()
    }

    /// Where transmitter and receiver are, metres.
    #[must_use]
    pub fn ends(&self) -> [DVec2; 2] {
        let left = DVec2::from_angle(self.direction_rad()).perp();
        [0.5, -0.5].map(|side| self.position() + side * self.separation_m * left)
    }

    /// The point straight ahead at a range in metres.
    #[must_use]
    pub fn point_at(&self, range_m: f64) -> DVec2 {
        self.position() + range_m * DVec2::from_angle(self.direction_rad())
    }

    /// The middle as a pose whose heading is the direction.
    #[must_use]
    pub const fn pose(&self) -> Pose {
        Pose { x_m: self.x_m, y_m: self.y_m, heading_deg: self.direction_deg }
    }
}

impl Mounting {
    /// The viewpoint of a transducer so mounted, with its rotation axis at `axis` and turned to the heading
    /// of that pose.
    #[must_use]
    pub fn viewpoint(&self, axis: &Pose) -> Viewpoint {
        let direction_deg = wrap_360(axis.heading_deg);
        let [transmitter, receiver] = self.places(axis.position(), direction_deg.to_radians());
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
    fn a_face_beside_its_axis_turns_round_it() {
        let mounting =
            Mounting { ahead_m: 0.1, left_m: 0.02, separation_m: 0.026, ..Mounting::default() };
        for (heading_deg, middle) in
            [(0.0, [1.1, 2.02]), (90.0, [0.98, 2.1]), (-180.0, [0.9, 1.98]), (450.0, [0.98, 2.1])]
        {
            let axis = Pose { x_m: 1.0, y_m: 2.0, heading_deg };
            let viewpoint = mounting.viewpoint(&axis);
            assert!(viewpoint.position().distance(middle.into()) < 1e-12, "{heading_deg}");
            let places = mounting.places(axis.position(), heading_deg.to_radians());
            for (end, place) in viewpoint.ends().into_iter().zip(places) {
                assert!(end.distance(place) < 1e-12, "{heading_deg}");
            }
            let ahead = viewpoint.point_at(2.0) - viewpoint.position();
            assert!((ahead - 2.0 * DVec2::from_angle(heading_deg.to_radians())).length() < 1e-12);
        }
    }
}
