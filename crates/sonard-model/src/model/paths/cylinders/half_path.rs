//! Half-paths: from transmitter or receiver to a cylinder's surface.
//!
//! A half-path is the set of all rays of a tube (or of a beam) that hit a cylinder between two
//! contacts. Two half-paths at one cylinder are connected to an echo where one leaves as the other
//! arrives ([`connect`](super::connect)).

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
        beams::{LitCylinder, RayLeg},
        floor::{AngleSpan, TracingPlan},
    },
};

/// Accuracy of contacts, radians.
const EXACT_RAD: f64 = 1e-12;

/// Rays to a part of a cylinder's surface, all reflected by the same surfaces before.
#[derive(Debug)]
pub(crate) struct HalfPath {
    pub(crate) cylinder: u32,
    /// The initial beam, in
    /// [`Beams::to_cylinders`](crate::model::paths::beams::Beams::to_cylinders).
    pub(crate) view: u32,
    /// Link as in [`CylinderRay`](super::rays::CylinderRay); [`DIRECT`] for a beam that arrives
    /// directly.
    pub(crate) link: u32,
    /// Surfaces after the first cylinder.
    pub(crate) surfaces: Surfaces,
    /// Number of cylinders before this one.
    pub(crate) level: u16,
    pub(crate) order: u16,
    pub(crate) gain: f64,
    /// Interval of contacts with the first cylinder, radians.
    pub(crate) span: AngleSpan,
    /// Rays at the ends of the span before they arrive here; for a beam after the contact.
    pub(crate) borders: [Front; 2],
    pub(crate) mirrored: bool,
    pub(crate) triangle: u32,
    /// Contacts at the ends, by increasing angle around this cylinder.
    pub(crate) ends: [Contact; 2],
    pub(crate) departures: Departures,
    /// Lower bound of the length of its rays, metres.
    pub(crate) min_m: f64,
    /// Minima of length, width and growth where the rays arrive.
    pub(crate) spread: [f64; 3],
    pub(crate) strength: Strength,
}

/// Link of a half-path that has touched no cylinder before.
pub(crate) const DIRECT: u32 = u32::MAX - 1;

/// Traces the rays of a half-path.
pub(crate) struct HalfPathTracer<'a> {
    pub(crate) half_path: &'a HalfPath,
    tracer: Tracer<'a>,
}

impl<'a> HalfPathTracer<'a> {
    pub(crate) fn new(
        plan: &'a TracingPlan,
        views: &'a [LitCylinder],
        half_path: &'a HalfPath,
    ) -> Self {
        let view = &views[half_path.view as usize];
        Self { half_path, tracer: Tracer::new(plan, view, &half_path.surfaces) }
    }

    /// Possible slopes of the rays, from the beam before their first cylinder.
    pub(crate) fn slopes(&self) -> u32 {
        self.tracer.view.beam.slopes
    }

    /// Contact with this cylinder of the ray that touched its first cylinder at `at_rad`; its angle
    /// is less than half a turn from `near_rad`.
    pub(crate) fn contact(&self, at_rad: f64, near_rad: f64) -> Contact {
        if self.half_path.link == DIRECT {
            return self.tracer.first_contact(at_rad);
        }
        let front = self.tracer.front(at_rad);
        let circle = &self.tracer.plan.cylinders.circles[self.half_path.cylinder as usize];
        Contact::from_front(&front, circle, self.half_path.mirrored, at_rad, near_rad)
    }

    /// Finds the ray that arrives at an angle around the cylinder between the ends.
    pub(crate) fn contact_at(&self, angle_rad: f64, near_rad: f64) -> Contact {
        let AngleSpan { from_rad, to_rad } = self.half_path.span;
        let mut ends = self.half_path.ends;
        if !self.half_path.mirrored {
            ends.reverse();
        }
        let end = |at: f64, end: &Contact| End {
            at,
            value: end.angle_rad - angle_rad,
            slope: end.angle_derivative,
        };
        let mut last = None;
        let ends = [end(from_rad, &ends[0]), end(to_rad, &ends[1])];
        let at_rad = zero_between(ends, EXACT_RAD, |at| {
            let contact = self.contact(at, near_rad);
            last = Some(contact);
            (contact.angle_rad - angle_rad, contact.angle_derivative)
        });
        let found = last.filter(|contact| contact.at_rad == at_rad);
        found.unwrap_or_else(|| self.contact(at_rad, near_rad))
    }

    /// Direction in which the ray leaves.
    pub(crate) fn departure(&self, at_rad: f64) -> DVec2 {
        self.tracer.departure(at_rad)
    }

    /// Leg from the beam's image to the first cylinder.
    pub(crate) fn leg(&self, at_rad: f64) -> RayLeg {
        self.tracer.leg(at_rad)
    }
}
