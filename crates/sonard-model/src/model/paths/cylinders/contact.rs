//! Rays at their contacts with cylinders.

use super::front::Front;
use crate::{
    geometry::{DVec2, wrap_pi},
    model::paths::floor::PlanCircle,
};

/// A ray at its contact with a cylinder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contact {
    /// Contact with the ray's first cylinder, radians.
    pub(crate) at_rad: f64,
    /// Contact with this cylinder: angle around the centre, radians.
    pub(crate) angle_rad: f64,
    /// Derivative of `angle_rad` with respect to `at_rad`.
    pub(crate) angle_derivative: f64,
    /// Sine of the angle of incidence, positive for a ray that runs counter-clockwise.
    pub(crate) slope: f64,
    /// Cosine of the angle of incidence.
    pub(crate) cosine: f64,
    pub(crate) length_m: f64,
    pub(crate) width_m: f64,
    pub(crate) growth: f64,
}

impl Contact {
    /// Computes the contact with a circle of a ray that leaves its last surface as `front`.
    /// `mirrored` is as in [`Tube`](super::tube::Tube); the angle is less than half a turn from
    /// `near_rad`.
    pub(crate) fn from_front(
        front: &Front,
        circle: &PlanCircle,
        mirrored: bool,
        at_rad: f64,
        near_rad: f64,
    ) -> Self {
        Self::at(front.onto(circle), circle, mirrored, at_rad, near_rad)
    }

    /// Computes the contact of a ray at the circle, from the normal there and the cosine of the
    /// angle of incidence.
    pub(crate) fn at(
        (hit, normal, cosine): (Front, DVec2, f64),
        circle: &PlanCircle,
        mirrored: bool,
        at_rad: f64,
        near_rad: f64,
    ) -> Self {
        let angle_rad = near_rad + wrap_pi(normal.to_angle() - near_rad);
        // Seen towards the surface, counter-clockwise is to the right.
        let sense = if mirrored { 1.0 } else { -1.0 };
        Self {
            at_rad,
            angle_rad,
            angle_derivative: sense * hit.width_m * hit.departure_per_contact
                / (circle.radius_m * cosine),
            slope: normal.perp_dot(hit.along),
            cosine,
            length_m: hit.length_m,
            width_m: hit.width_m,
            growth: hit.growth,
        }
    }
}
