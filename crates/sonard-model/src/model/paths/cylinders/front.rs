//! Rays that convex surfaces spread.

use crate::{
    geometry::DVec2,
    model::{
        Reflector,
        paths::floor::{PlanCircle, TracingPlan, WallMirror},
    },
};

/// Keeps values finite for rays that graze a cylinder, which spread without bounds.
pub(crate) const MIN_COSINE: f64 = 1e-9;

/// A ray as it leaves a surface, and the wave front around it.
///
/// Only cylinders change the spreading of the front; walls turn it. `width_m` is linear along the
/// ray, with slope `growth`, so the front's radius of curvature is their quotient.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Front {
    pub(crate) origin: DVec2,
    /// Direction of the ray, a unit vector.
    pub(crate) along: DVec2,
    /// Length of the path so far, metres.
    pub(crate) length_m: f64,
    /// Distance to the neighbouring ray per angle between them at departure, metres, and the growth
    /// of that distance per metre. Without cylinders the values are `length_m` and 1.
    pub(crate) width_m: f64,
    pub(crate) growth: f64,
    /// Angle between neighbouring rays at departure per angle between their first contacts, seen
    /// from the first cylinder's centre.
    pub(crate) departure_per_contact: f64,
}

impl Front {
    /// Distance of a point to the left of the ray, metres.
    pub(crate) fn offset_m(&self, point: DVec2) -> f64 {
        self.along.perp_dot(point - self.origin)
    }

    /// Distance along the ray to the foot of the perpendicular from a point, metres.
    pub(crate) fn ahead_m(&self, point: DVec2) -> f64 {
        self.along.dot(point - self.origin)
    }

    /// Returns the front advanced by a distance.
    pub(crate) fn moved(&self, distance_m: f64) -> Self {
        Self {
            origin: self.origin + distance_m * self.along,
            length_m: self.length_m + distance_m,
            width_m: self.width_m + distance_m * self.growth,
            ..*self
        }
    }

    /// Radius of curvature of the wave front, metres.
    pub(crate) fn radius_m(&self) -> f64 {
        self.width_m / self.growth
    }

    fn off_wall(&self, wall: &WallMirror) -> Self {
        let mirror = &wall.mirror;
        let distance_m = -mirror.signed_distance_m(self.origin) / mirror.normal.dot(self.along);
        let hit = self.moved(distance_m);
        Self { along: mirror.image_of_direction(self.along), ..hit }
    }

    /// Advances the front to the outside of a circle. Also returns the normal there and the cosine
    /// of the angle of incidence. A ray that misses the circle by rounding touches it.
    pub(crate) fn onto(&self, circle: &PlanCircle) -> (Self, DVec2, f64) {
        let offset_m = self.offset_m(circle.center);
        let half_chord = circle.radius_m * circle.radius_m - offset_m * offset_m;
        let hit = self.moved(self.ahead_m(circle.center) - half_chord.max(0.0).sqrt());
        let normal = (hit.origin - circle.center).normalize();
        (hit, normal, (-normal.dot(hit.along)).max(MIN_COSINE))
    }

    /// Reflects the front at the outside of a circle, by the mirror equation in the plane of
    /// incidence (for instance Keller and Lewis 1995): the curvature of the front grows by
    /// `2 / (r cos i)`. With `width_m` equal on both sides of the surface, `growth` (curvature
    /// times width) grows by `2 w / (r cos i)`.
    pub(crate) fn off_circle(&self, circle: &PlanCircle) -> Self {
        let (hit, normal, cosine) = self.onto(circle);
        Self {
            along: hit.along + 2.0 * cosine * normal,
            growth: hit.growth + 2.0 * hit.width_m / (circle.radius_m * cosine),
            ..hit
        }
    }
}

impl TracingPlan {
    /// Reflects a ray at one more surface.
    pub(crate) fn reflect(&self, front: &Front, surface: Reflector) -> Front {
        match surface {
            Reflector::Wall(wall) => front.off_wall(&self.walls[wall as usize]),
            Reflector::Cylinder(cylinder) => {
                front.off_circle(&self.cylinders.circles[cylinder as usize])
            }
            Reflector::Floor | Reflector::Ceiling => *front,
        }
    }
}
