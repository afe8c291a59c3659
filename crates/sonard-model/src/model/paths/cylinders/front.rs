//! Rays that convex surfaces spread.

use crate::{
    geometry::DVec2,
    model::{
        Reflector,
        paths::plan::{Circle, Plan, WallMirror},
    },
};

/// Rays that graze a cylinder spread without bounds; this keeps their figures finite.
pub(crate) const LEAST_COSINE: f64 = 1e-9;

/// A ray where it leaves a surface, and the wave front around it.
///
/// Only cylinders change how the front spreads; walls turn it. `width_m` is linear along the ray, with
/// slope `growth`, so the front's radius of curvature is their quotient.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Front {
    pub(crate) origin: DVec2,
    /// Unit vector.
    pub(crate) along: DVec2,
    /// Length of the path so far, metres.
    pub(crate) length_m: f64,
    /// Distance to the neighbouring ray over the angle between them at departure, metres, and
    /// its growth a metre: without cylinders `length_m` and 1.
    pub(crate) width_m: f64,
    pub(crate) growth: f64,
    /// That angle over the one between their first contacts, seen from the first cylinder's centre.
    pub(crate) rate: f64,
}

impl Front {
    /// Distance of a point to the left of the ray, metres.
    pub(crate) fn offset_m(&self, point: DVec2) -> f64 {
        self.along.perp_dot(point - self.origin)
    }

    /// Distance along the ray to abreast of a point, metres.
    pub(crate) fn ahead_m(&self, point: DVec2) -> f64 {
        self.along.dot(point - self.origin)
    }

    /// So much farther on.
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
        let distance_m = -mirror.height_m(self.origin) / mirror.normal.dot(self.along);
        let hit = self.moved(distance_m);
        Self { along: mirror.turn(self.along), ..hit }
    }

    /// Moved to the outside of a circle, with the normal there and the cosine of the angle of
    /// incidence. A ray that misses it by rounding touches it.
    pub(crate) fn onto(&self, circle: &Circle) -> (Self, DVec2, f64) {
        let offset_m = self.offset_m(circle.center);
        let half_chord = circle.radius_m * circle.radius_m - offset_m * offset_m;
        let hit = self.moved(self.ahead_m(circle.center) - half_chord.max(0.0).sqrt());
        let normal = (hit.origin - circle.center).normalize();
        (hit, normal, (-normal.dot(hit.along)).max(LEAST_COSINE))
    }

    /// Off the outside of a circle: the mirror equation in the plane of incidence (Keller and Lewis
    /// 1995, for instance), by which the curvature of the front grows by `2 / (r cos i)`. With `width_m`
    /// the same on both sides of the surface, `growth` (curvature times width) grows by `2 w / (r cos i)`.
    pub(crate) fn off_circle(&self, circle: &Circle) -> Self {
        let (hit, normal, cosine) = self.onto(circle);
        Self {
            along: hit.along + 2.0 * cosine * normal,
            growth: hit.growth + 2.0 * hit.width_m / (circle.radius_m * cosine),
            ..hit
        }
    }
}

impl Plan {
    /// A ray off one more surface.
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
