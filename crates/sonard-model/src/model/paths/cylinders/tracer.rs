//! Rays by way of cylinders, traced from their contact with the first one.

use smallvec::SmallVec;

use super::{
    contact::Contact,
    front::{Front, LEAST_COSINE},
};
use crate::{
    geometry::{DVec2, Mirror},
    model::{
        Reflector,
        paths::{
            beams::{Leg, View},
            plan::{Circle, Plan},
        },
    },
};

/// Follows rays of one beam by way of its cylinder and other surfaces.
///
/// A ray is known by its contact with the first cylinder alone (the angle around the centre): from the beam's
/// image straight there, and from there by reflection off `surfaces` in order.
pub(crate) struct Tracer<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) view: &'a View,
    pub(crate) surfaces: &'a [Reflector],
    /// The same surfaces, walls one after the other as one.
    hops: SmallVec<[Hop; 4]>,
}

/// What a ray meets after its first cylinder.
#[derive(Debug, Clone, Copy)]
enum Hop {
    Cylinder(u32),
    /// Walls, up to `last`.
    Walls {
        images: Images,
        last: u32,
    },
}

/// Mirror images by several walls: a turn, perhaps with a mirror, and a shift.
#[derive(Debug, Clone, Copy)]
struct Images {
    /// Those of the unit vectors, and of the origin.
    x: DVec2,
    y: DVec2,
    origin: DVec2,
}

impl Images {
    const NONE: Self = Self { x: DVec2::X, y: DVec2::Y, origin: DVec2::ZERO };

    /// By one more wall.
    fn by(self, mirror: &Mirror) -> Self {
        let Self { x, y, origin } = self;
        Self { x: mirror.turn(x), y: mirror.turn(y), origin: mirror.image(origin) }
    }

    fn of_direction(&self, direction: DVec2) -> DVec2 {
        direction.x * self.x + direction.y * self.y
    }

    fn of_point(&self, point: DVec2) -> DVec2 {
        self.origin + self.of_direction(point)
    }
}

fn hops(plan: &Plan, surfaces: &[Reflector]) -> SmallVec<[Hop; 4]> {
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
    pub(crate) fn new(plan: &'a Plan, view: &'a View, surfaces: &'a [Reflector]) -> Self {
        Self { plan, view, surfaces, hops: hops(plan, surfaces) }
    }

    /// The ray as it leaves its last surface.
    ///
    /// Over walls it is straight in their images; where it crosses the last one it is in the plan again.
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
                    let distance_m = -mirror.height_m(origin) / mirror.normal.dot(along);
                    Front { origin, along, ..front }.moved(distance_m)
                }
            };
        }
        front
    }

    /// Its contacts with the surfaces, the first cylinder included.
    pub(crate) fn contacts(&self, contact_rad: f64) -> Vec<DVec2> {
        let mut front = self.first(contact_rad);
        let mut contacts = vec![front.origin];
        for &surface in self.surfaces {
            front = self.plan.reflect(&front, surface);
            contacts.push(front.origin);
        }
        contacts
    }

    /// From the beam's image to the first contact.
    pub(crate) fn leg(&self, contact_rad: f64) -> Leg {
        let run = self.circle().point(contact_rad) - self.view.beam.image;
        Leg { node: self.view.beam.node, run }
    }

    /// The direction in which the ray leaves the start.
    pub(crate) fn departure(&self, contact_rad: f64) -> DVec2 {
        self.view.beam.departure(self.leg(contact_rad).run.normalize_or_zero())
    }

    /// The ray where it meets the first cylinder.
    pub(crate) fn first_contact(&self, contact_rad: f64) -> Contact {
        let normal = DVec2::from_angle(contact_rad);
        let circle = self.circle();
        let run = circle.center + circle.radius_m * normal - self.view.beam.image;
        let length_m = run.length();
        let along = run / length_m;
        Contact {
            at_rad: contact_rad,
            angle_rad: contact_rad,
            angle_rate: 1.0,
            slope: normal.perp_dot(along),
            cosine: (-normal.dot(along)).max(LEAST_COSINE),
            length_m,
            width_m: length_m,
            growth: 1.0,
        }
    }

    /// The ray as it leaves the first cylinder, by the mirror equation for a front of radius `length_m`.
    fn first(&self, contact_rad: f64) -> Front {
        let circle = self.circle();
        let normal = DVec2::from_angle(contact_rad);
        let hit = circle.center + circle.radius_m * normal;
        let run = hit - self.view.beam.image;
        let length_m = run.length();
        let along = run / length_m;
        let cosine = (-normal.dot(along)).max(LEAST_COSINE);
        Front {
            origin: hit,
            along: along + 2.0 * cosine * normal,
            length_m,
            width_m: length_m,
            growth: 1.0 + 2.0 * length_m / (circle.radius_m * cosine),
            rate: circle.radius_m * cosine / length_m,
        }
    }

    pub(crate) fn circle(&self) -> &'a Circle {
        &self.plan.cylinders.circles[self.view.cylinder as usize]
    }
}
