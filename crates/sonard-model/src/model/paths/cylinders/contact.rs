//! Rays where they meet cylinders.

use super::front::Front;
use crate::{
    geometry::{DVec2, wrap_pi},
    model::paths::plan::Circle,
};

/// A ray where it meets a cylinder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contact {
    /// Its contact with its first cylinder, radians.
    pub(crate) at_rad: f64,
    /// Its contact with this one: angle around the centre, radians.
    pub(crate) angle_rad: f64,
    /// Derivative of `angle_rad` by `at_rad`.
    pub(crate) angle_rate: f64,
    /// Sine of the angle of incidence, positive for a ray that runs counter-clockwise.
    pub(crate) slope: f64,
    /// Its cosine.
    pub(crate) cosine: f64,
    pub(crate) length_m: f64,
    pub(crate) width_m: f64,
    pub(crate) growth: f64,
}

impl Contact {
    /// The contact of a ray that leaves its last surface like this with a circle. `mirrored` as in
    /// [`Tube`](super::tube::Tube); its angle is less than half a turn from `near_rad`.
    pub(crate) fn of(
        front: &Front,
        circle: &Circle,
        mirrored: bool,
        at_rad: f64,
        near_rad: f64,
    ) -> Self {
        Self::at(front.onto(circle), circle, mirrored, at_rad, near_rad)
    }

    /// The same of a ray at the circle, with the normal there and the cosine of the angle of incidence.
    pub(crate) fn at(
        (hit, normal, cosine): (Front, DVec2, f64),
        circle: &Circle,
        mirrored: bool,
        at_rad: f64,
        near_rad: f64,
    ) -> Self {
        let angle_rad = near_rad + wrap_pi(normal.to_angle() - near_rad);
        // Counter-clockwise is to the right for one who looks at the surface.
        let sense = if mirrored { 1.0 } else { -1.0 };
        Self {
            at_rad,
            angle_rad,
            angle_rate: sense * hit.width_m * hit.rate / (circle.radius_m * cosine),
            slope: normal.perp_dot(hit.along),
            cosine,
            length_m: hit.length_m,
            width_m: hit.width_m,
            growth: hit.growth,
        }
    }
}
