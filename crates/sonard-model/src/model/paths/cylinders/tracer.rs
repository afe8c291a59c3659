//! Rays by way of cylinders, traced from their contact with the first one.

use smallvec::SmallVec;

use super::{
    contact::Contact,
    front::{Front, MIN_COSINE},
};
use crate::{
    geometry::{DVec2, Mirror},
    model::{
        Reflector,
        paths::{
            beams::{LitCylinder, RayLeg},
            floor::{PlanCircle, TracingPlan},
        },
    },
};

/// Traces rays of one beam by way of its cylinder and further surfaces.
///
/// A ray is identified by its contact with the first cylinder alone (the angle around the centre):
/// from the beam's image straight to the contact, and from there by reflection off `surfaces` in
/// order.
pub(crate) struct Tracer<'a> {
    pub(crate) plan: &'a TracingPlan,
    pub(crate) view: &'a LitCylinder,
    pub(crate) surfaces: &'a [Reflector],
    /// `surfaces` with consecutive walls combined.
    hops: SmallVec<[Hop; 4]>,
}

/// Next surface or surfaces after the first cylinder.
#[derive(Debug, Clone, Copy)]
enum Hop {
    Cylinder(u32),
    /// Consecutive walls, up to `last`.
    Walls {
        images: Images,
        last: u32,
    },
}

/// Combined mirror image of several walls: a rotation, possibly with a reflection, and a
/// translation.
#[derive(Debug, Clone, Copy)]
struct Images {
    /// Images of the unit vectors and of the origin.
    x: DVec2,
    y: DVec2,
    origin: DVec2,
}

impl Images {
    const NONE: Self = Self { x: DVec2::X, y: DVec2::Y, origin: DVec2::ZERO };

    /// Appends the image by one more wall.
    fn by(self, mirror: &Mirror) -> Self {
        let Self { x, y, origin } = self;
        Self {
            x: mirror.image_of_direction(x),
            y: mirror.image_of_direction(y),
            origin: mirror.image(origin),
        }
    }

    fn of_direction(&self, direction: DVec2) -> DVec2 {
        direction.x * self.x + direction.y * self.y
    }

    fn of_point(&self, point: DVec2) -> DVec2 {
        self.origin + self.of_direction(point)
    }
}

fn hops(plan: &TracingPlan, surfaces: &[Reflector]) -> SmallVec<[Hop; 4]> {
    let mut hops = SmallVec::new();
    for &surface in surfaces {
        match (surface, hops.last_mut()) {
            (Reflector::Cylinder(cylinder), _) => hops.push(Hop::Cylinder(cylinder)),
            (Reflector::Wall(wall), Some(Hop::Walls { images, last })) => {
                *images = images.by(&plan.walls[wall as usize].mirror);
                *last = wall;
            }
            (Reflector::Wall(wall), _) => {
                let images = Images::NONE.by(&plan.walls[wall as usize].mirror);
                hops.push(Hop::Walls { images, last: wall });
            }
            (Reflector::Floor | Reflector::Ceiling, _) => {}
        }
    }
    hops
}

impl<'a> Tracer<'a> {
    pub(crate) fn new(
        plan: &'a TracingPlan,
        view: &'a LitCylinder,
        surfaces: &'a [Reflector],
    ) -> Self {
        Self { plan, view, surfaces, hops: hops(plan, surfaces) }
    }

    /// Computes the ray as it leaves its last surface.
    ///
    /// Over walls the ray is straight in their images; where it crosses the last one it is in the
    /// plan again.
    pub(crate) fn front(&self, contact_rad: f64) -> Front {
        let mut front = self.first(contact_rad);
        for hop in &self.hops {
            front = match hop {
                Hop::Cylinder(cylinder) => {
                    front.off_circle(&self.plan.cylinders.circles[*cylinder as usize])
                }
                Hop::Walls { images, last } => {
                    let origin = images.of_point(front.origin);
                    let along = images.of_direction(front.along);
                    let mirror = &self.plan.walls[*last as usize].mirror;
                    let distance_m = -mirror.signed_distance_m(origin) / mirror.normal.dot(along);
                    Front { origin, along, ..front }.moved(distance_m)
                }
            };
        }
        front
    }

    /// Contact points with the surfaces, the first cylinder included.
    pub(crate) fn contacts(&self, contact_rad: f64) -> Vec<DVec2> {
        let mut front = self.first(contact_rad);
        let mut contacts = vec![front.origin];
        for &surface in self.surfaces {
            front = self.plan.reflect(&front, surface);
            contacts.push(front.origin);
        }
        contacts
    }

    /// Leg from the beam's image to the first contact.
    pub(crate) fn leg(&self, contact_rad: f64) -> RayLeg {
        let run = self.circle().point(contact_rad) - self.view.beam.image;
        RayLeg { node: self.view.beam.node, run }
    }

    /// Direction in which the ray leaves the start.
    pub(crate) fn departure(&self, contact_rad: f64) -> DVec2 {
        self.view.beam.departure(self.leg(contact_rad).run.normalize_or_zero())
    }

    /// Computes the contact with the first cylinder.
    pub(crate) fn first_contact(&self, contact_rad: f64) -> Contact {
        let normal = DVec2::from_angle(contact_rad);
        let circle = self.circle();
        let run = circle.center + circle.radius_m * normal - self.view.beam.image;
        let length_m = run.length();
        let along = run / length_m;
        Contact {
            at_rad: contact_rad,
            angle_rad: contact_rad,
            angle_derivative: 1.0,
            slope: normal.perp_dot(along),
            cosine: (-normal.dot(along)).max(MIN_COSINE),
            length_m,
            width_m: length_m,
            growth: 1.0,
        }
    }

    /// Computes the ray as it leaves the first cylinder, by the mirror equation for a front of
    /// radius `length_m`.
    fn first(&self, contact_rad: f64) -> Front {
        let circle = self.circle();
        let normal = DVec2::from_angle(contact_rad);
        let hit = circle.center + circle.radius_m * normal;
        let run = hit - self.view.beam.image;
        let length_m = run.length();
        let along = run / length_m;
        let cosine = (-normal.dot(along)).max(MIN_COSINE);
        Front {
            origin: hit,
            along: along + 2.0 * cosine * normal,
            length_m,
            width_m: length_m,
            growth: 1.0 + 2.0 * length_m / (circle.radius_m * cosine),
            departure_per_contact: circle.radius_m * cosine / length_m,
        }
    }

    pub(crate) fn circle(&self) -> &'a PlanCircle {
        &self.plan.cylinders.circles[self.view.cylinder as usize]
    }
}
