//! Contacts of tubes with cylinders.

use std::f64::consts::TAU;

use smallvec::SmallVec;

use super::{
    contact::Contact,
    departures::Departures,
    front::Front,
    grow::TubeGrower,
    half_path::HalfPath,
    strength::Strength,
    tracer::Tracer,
    tube::{Tube, front_past, min_of_convex, min_spread, ray_past},
};
use crate::{
    geometry::DVec2,
    model::{
        Reflector,
        paths::{
            floor::{AngleSpan, PlanCircle, SurfaceArc},
            tolerance::TIE_M,
        },
    },
};

/// Arcs that a tube hits in its triangle, and the parts of the tube that reach each first.
///
/// Invariant: between two adjacent [`cuts`](Self::cuts) all rays hit the same arcs in the same
/// order, since arcs do not cross.
pub(crate) struct Hits<'a> {
    arcs: SmallVec<[ArcHit<'a>; 2]>,
}

/// Part of a tube that would hit an arc if nothing were in front of it.
struct ArcHit<'a> {
    circle: &'a PlanCircle,
    cylinder: u32,
    span: AngleSpan,
    /// Parts of `span` that reach the arc.
    seen: SmallVec<[AngleSpan; 1]>,
}

impl<'a> Hits<'a> {
    /// Finds the arcs that a tube hits; their occlusion of each other is resolved later.
    pub(crate) fn new(tube: &Tube, tracer: &Tracer<'a>) -> Self {
        let cylinders = &tracer.plan.cylinders;
        let first = Reflector::Cylinder(tracer.view.cylinder);
        let last = tracer.surfaces.last().copied().unwrap_or(first);
        let mut arcs = SmallVec::new();
        for arc in cylinders.in_triangle(tube.triangle) {
            // A circle is convex: rays that leave it do not return to it directly.
            if last == Reflector::Cylinder(arc.cylinder) {
                continue;
            }
            let (cylinder, circle) = (arc.cylinder, &cylinders.circles[arc.cylinder as usize]);
            let spans = hit_spans(tube, tracer, circle, arc);
            let hit = |span| ArcHit { circle, cylinder, span, seen: SmallVec::new() };
            arcs.extend(spans.into_iter().map(hit));
        }
        Self { arcs }
    }

    /// Contacts where rays begin or cease to hit an arc.
    pub(crate) fn cuts(&self) -> impl Iterator<Item = f64> {
        self.arcs.iter().flat_map(|hit| [hit.span.from_rad, hit.span.to_rad])
    }

    /// Assigns a part between two cuts, with its middle ray, to the arcs that it reaches, in order,
    /// up to the first opaque one. Returns `true` if the part passes them all. Parts arrive by
    /// increasing contact.
    pub(crate) fn lets_pass(&mut self, part: AngleSpan, middle: &Front) -> bool {
        let at = 0.5 * (part.from_rad + part.to_rad);
        let is_reached = |hit: &&mut ArcHit| hit.span.from_rad < at && at < hit.span.to_rad;
        let mut reached: SmallVec<[(f64, &mut ArcHit); 2]> = self
            .arcs
            .iter_mut()
            .filter(is_reached)
            .map(|hit| (middle.onto(hit.circle).0.length_m, hit))
            .collect();
        reached.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, hit) in reached {
            match hit.seen.last_mut() {
                Some(last) if last.to_rad == part.from_rad => last.to_rad = part.to_rad,
                _ => hit.seen.push(part),
            }
            if hit.circle.is_opaque {
                return false;
            }
        }
        true
    }

    /// Cylinders that are hit, with the parts that hit them.
    pub(crate) fn parts(&self) -> impl Iterator<Item = (u32, AngleSpan)> {
        self.arcs.iter().flat_map(|hit| hit.seen.iter().map(|&span| (hit.cylinder, span)))
    }
}

impl TubeGrower<'_> {
    /// Returns the half-path of a part that hits a cylinder, if it can still give an echo.
    pub(crate) fn half_path(
        &self,
        tube: &Tube,
        tracer: &Tracer,
        cylinder: u32,
        span: AngleSpan,
    ) -> Option<HalfPath> {
        let settings = &self.plan.settings;
        let circle = &self.plan.cylinders.circles[cylinder as usize];
        if !settings.allows(tube.order + 1) {
            return None;
        }
        let AngleSpan { from_rad, to_rad } = span;
        let borders = [from_rad, to_rad].map(|at| tracer.front(at));
        let middle = tracer.front(0.5 * (from_rad + to_rad));
        let hits = [&borders[0], &borders[1], &middle].map(|front| front.onto(circle));
        let spread = min_spread(&hits.map(|hit| hit.0));
        let strength = Strength::new(tube.gain, spread, self.radius_m, settings);
        let near = hits[2].1.to_angle();
        let mut ends = [(hits[0], from_rad), (hits[1], to_rad)]
            .map(|(hit, at)| Contact::at(hit, circle, tube.mirrored, at, near));
        if !tube.mirrored {
            ends.reverse();
        }
        let min_m = min_contact_length_m(&ends, circle.radius_m);
        let whole_m = min_m + self.back_m(circle);
        let is_viable = self.may_be_detected(&strength, min_m, self.partners_of(tube))
            || self.has_edges && self.is_viable_at_edge(tube.gain, spread, whole_m);
        if !is_viable || whole_m > settings.max_path_m {
            return None;
        }
        Some(HalfPath {
            cylinder,
            view: tube.view,
            link: tube.link,
            surfaces: tracer.surfaces.iter().copied().collect(),
            level: tube.level,
            order: tube.order,
            gain: tube.gain,
            span,
            borders,
            mirrored: tube.mirrored,
            triangle: tube.triangle,
            ends,
            departures: Departures::between(tracer.departure(from_rad), tracer.departure(to_rad)),
            min_m,
            spread,
            strength,
        })
    }
}

/// Lower bound of the length of all rays to a part of a cylinder's surface, from those to its ends,
/// metres. The length is a convex function of the angle around the cylinder
/// ([`stationary`](super::stationary)).
fn min_contact_length_m(ends: &[Contact; 2], radius_m: f64) -> f64 {
    let width_m = radius_m * (ends[1].angle_rad - ends[0].angle_rad);
    let values = ends.each_ref().map(|end| end.length_m);
    let slopes = ends.each_ref().map(|end| width_m * end.slope);
    min_of_convex(values, slopes) - TIE_M
}

/// Computes the parts of a tube that hit an arc.
///
/// The tube is cut at the rays that touch the circle. The circle's illuminated angles (from contact
/// to contact, clockwise from the right border to the left one) are then cut at the ends of the
/// arc, whose rays are found in turn.
fn hit_spans(
    tube: &Tube,
    tracer: &Tracer,
    circle: &PlanCircle,
    arc: &SurfaceArc,
) -> SmallVec<[AngleSpan; 2]> {
    let [right, left] = tube.in_order();
    let AngleSpan { from_rad, to_rad } = tube.span;
    let (r, center) = (circle.radius_m, circle.center);
    let is_outside = right.offset_m(center) <= -r || left.offset_m(center) >= r;
    if is_outside {
        return SmallVec::new();
    }
    // Rays that touch the circle with its centre to their left and to their right.
    let touching = [(right, 1.0), (left, -1.0)].map(|(border, side)| {
        let beyond = side * border.offset_m(center) > r;
        let own = if std::ptr::eq(border, &tube.borders[0]) { from_rad } else { to_rad };
        if beyond { front_past(tube, tracer, center, side * r) } else { (own, *border) }
    });
    let ends = touching.each_ref().map(|ray| ray.0);
    // Contacts of these rays: clockwise around the circle from right to left.
    let [first, last] = touching.map(|(_, front)| front.onto(circle).1.to_angle());
    let turn = (first - last).rem_euclid(TAU);
    let lit = AngleSpan { from_rad: last, to_rad: last + turn };
    lit.common(&arc.span)
        .into_iter()
        .map(|part| {
            let at = |angle: f64, end: f64, own: f64| {
                let point: DVec2 = circle.point(angle);
                if angle == own { end } else { ray_past(tube, tracer, point, 0.0) }
            };
            let one = at(part.from_rad, ends[1], lit.from_rad);
            let other = at(part.to_rad, ends[0], lit.to_rad);
            AngleSpan { from_rad: one.min(other), to_rad: one.max(other) }
        })
        .filter(|span| {
            let middle = tracer.front(0.5 * (span.from_rad + span.to_rad));
            span.to_rad > span.from_rad && middle.ahead_m(center) > 0.0
        })
        .collect()
}
