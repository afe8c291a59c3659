//! Half-paths: from transmitter or receiver to a cylinder's surface.
//!
//! A half-path is all rays of a tube (or of a beam) that meet a cylinder between two contacts. Two of
//! them at one cylinder are connected to an echo where the one leaves as the other comes
//! ([`connect`](super::connect)).

use super::{
    contact::Contact,
    departures::Departures,
    front::Front,
    rays::Surfaces,
    root::{End, zero_between},
    strength::Strength,
    tracer::Tracer,
};
use crate::{
    geometry::DVec2,
    model::paths::{
        beams::{Leg, View},
        plan::{Plan, Span},
    },
};

/// Contacts are found to within this, radians.
const EXACT_RAD: f64 = 1e-12;

/// Rays to a part of a cylinder's surface, all of which have met the same surfaces before.
#[derive(Debug)]
pub(crate) struct HalfPath {
    pub(crate) cylinder: u32,
    /// The beam that it begins with, in [`Beams::to_cylinders`](crate::model::paths::beams::Beams::to_cylinders).
    pub(crate) view: u32,
    /// See [`CylinderRay`](super::rays::CylinderRay); [`DIRECT`] for a beam that comes straight here.
    pub(crate) link: u32,
    /// The surfaces that it met after its first cylinder.
    pub(crate) surfaces: Surfaces,
    /// Cylinders met before.
    pub(crate) level: u16,
    pub(crate) order: u16,
    pub(crate) gain: f64,
    /// Between which contacts with its first cylinder, radians.
    pub(crate) span: Span,
    /// The rays at the ends of the span before they come here; for a beam after that.
    pub(crate) borders: [Front; 2],
    pub(crate) mirrored: bool,
    pub(crate) triangle: u32,
    /// Its ends here, by growing angle around this cylinder.
    pub(crate) ends: [Contact; 2],
    pub(crate) departures: Departures,
    /// Its shortest ray comes this far, metres.
    pub(crate) least_m: f64,
    pub(crate) strength: Strength,
}

/// Marks a half-path that has met no cylinder before.
pub(crate) const DIRECT: u32 = u32::MAX - 1;

/// Follows a half-path's rays.
pub(crate) struct HalfPathTracer<'a> {
    pub(crate) half_path: &'a HalfPath,
    tracer: Tracer<'a>,
}

impl<'a> HalfPathTracer<'a> {
    pub(crate) fn new(plan: &'a Plan, views: &'a [View], half_path: &'a HalfPath) -> Self {
        let view = &views[half_path.view as usize];
        Self { half_path, tracer: Tracer::new(plan, view, &half_path.surfaces) }
    }

    /// How steeply its rays can climb, as far as the beam before its first cylinder tells.
    pub(crate) fn slopes(&self) -> u32 {
        self.tracer.view.beam.slopes
    }

    /// The ray that met its first cylinder at `at_rad`, where it meets this one, less
    /// than half a turn from `near_rad`.
    pub(crate) fn contact(&self, at_rad: f64, near_rad: f64) -> Contact {
        if self.half_path.link == DIRECT {
            return self.tracer.first_contact(at_rad);
        }
        let front = self.tracer.front(at_rad);
        let circle = &self.tracer.plan.cylinders.circles[self.half_path.cylinder as usize];
        Contact::of(&front, circle, self.half_path.mirrored, at_rad, near_rad)
    }

    /// The ray that comes to an angle around the cylinder between its ends.
    pub(crate) fn contact_at(&self, angle_rad: f64, near_rad: f64) -> Contact {
        let Span { from_rad, to_rad } = self.half_path.span;
        let mut ends = self.half_path.ends;
        if !self.half_path.mirrored {
            ends.reverse();
        }
        let end = |at: f64, end: &Contact| End {
            at,
            value: end.angle_rad - angle_rad,
            slope: end.angle_rate,
        };
        let mut last = None;
        let ends = [end(from_rad, &ends[0]), end(to_rad, &ends[1])];
        let at_rad = zero_between(ends, EXACT_RAD, |at| {
            let contact = self.contact(at, near_rad);
            last = Some(contact);
            (contact.angle_rad - angle_rad, contact.angle_rate)
        });
        let found = last.filter(|contact| contact.at_rad == at_rad);
        found.unwrap_or_else(|| self.contact(at_rad, near_rad))
    }

    /// The direction in which that ray leaves.
    pub(crate) fn departure(&self, at_rad: f64) -> DVec2 {
        self.tracer.departure(at_rad)
    }

    /// From the beam's image to its first cylinder.
    pub(crate) fn leg(&self, at_rad: f64) -> Leg {
        self.tracer.leg(at_rad)
    }
}
