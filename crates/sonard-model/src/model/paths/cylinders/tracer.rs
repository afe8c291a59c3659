//! Rays by way of cylinders, traced from their contact with the first one.

use super::{
    contact::Contact,
    front::{Front, LEAST_COSINE},
};
use crate::{
    geometry::DVec2,
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
}

impl<'a> Tracer<'a> {
    /// The ray as it leaves its last surface.
    pub(crate) fn front(&self, contact_rad: f64) -> Front {
        let first = self.first(contact_rad);
        self.surfaces.iter().fold(first, |front, &surface| self.plan.reflect(&front, surface))
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
