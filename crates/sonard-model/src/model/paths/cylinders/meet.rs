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
    tube::{Tube, front_past, ray_past},
};
use crate::{
    geometry::DVec2,
    model::{
        Reflector,
        paths::plan::{Circle, Span, SurfaceArc},
    },
};

/// The arcs that a tube meets in its triangle, and the parts of it that come to each before anything else.
///
/// Invariant: between two [`cuts`](Self::cuts) side by side all rays meet the same arcs in the same order, since
/// arcs do not cross.
pub(crate) struct Hits<'a> {
    arcs: SmallVec<[Hit<'a>; 2]>,
}

/// The part of a tube that meets an arc, as far as nothing else is asked.
struct Hit<'a> {
    circle: &'a Circle,
    cylinder: u32,
    span: Span,
    /// Of it what comes there.
    seen: SmallVec<[Span; 1]>,
}

impl<'a> Hits<'a> {
    /// Those of a tube whose parts in front of each other are still to be told.
    pub(crate) fn of(tube: &Tube, tracer: &Tracer<'a>) -> Self {
        let cylinders = &tracer.plan.cylinders;
        let first = Reflector::Cylinder(tracer.view.cylinder);
        let last = tracer.surfaces.last().copied().unwrap_or(first);
        let mut arcs = SmallVec::new();
        for arc in cylinders.in_triangle(tube.triangle) {
            // A circle is convex: what leaves it does not come back to it by itself.
            if last == Reflector::Cylinder(arc.cylinder) {
                continue;
            }
            let (cylinder, circle) = (arc.cylinder, &cylinders.circles[arc.cylinder as usize]);
            let spans = met_spans(tube, tracer, circle, arc);
            let hit = |span| Hit { circle, cylinder, span, seen: SmallVec::new() };
            arcs.extend(spans.into_iter().map(hit));
        }
        Self { arcs }
    }

    /// Where rays begin or cease to meet an arc.
    pub(crate) fn cuts(&self) -> impl Iterator<Item = f64> {
        self.arcs.iter().flat_map(|hit| [hit.span.from_rad, hit.span.to_rad])
    }

    /// Takes a part between two cuts, with its middle ray: gives it to the arcs that it comes to, in order, up to
    /// the first that nothing passes. Whether it passes them all. Parts come by growing contact.
    pub(crate) fn lets_pass(&mut self, part: Span, middle: &Front) -> bool {
        let at = 0.5 * (part.from_rad + part.to_rad);
        let is_met = |hit: &&mut Hit| hit.span.from_rad < at && at < hit.span.to_rad;
        let mut met: SmallVec<[(f64, &mut Hit); 2]> = self
            .arcs
            .iter_mut()
            .filter(is_met)
            .map(|hit| (middle.onto(hit.circle).0.length_m, hit))
            .collect();
        met.sort_by(|one, other| one.0.total_cmp(&other.0));
        for (_, hit) in met {
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

    /// The cylinders that are met, and by which parts.
    pub(crate) fn met(&self) -> impl Iterator<Item = (u32, Span)> {
        self.arcs.iter().flat_map(|hit| hit.seen.iter().map(|&span| (hit.cylinder, span)))
    }
}

impl TubeGrower<'_> {
    /// The half-path of a part that meets a cylinder, if it is worth anything.
    pub(crate) fn half_path(
        &self,
        tube: &Tube,
        tracer: &Tracer,
        cylinder: u32,
        span: Span,
    ) -> Option<HalfPath> {
        let settings = &self.plan.settings;
        let circle = &self.plan.cylinders.circles[cylinder as usize];
        if !settings.allows(tube.order + 1) {
            return None;
        }
        let Span { from_rad, to_rad } = span;
        let borders = [from_rad, to_rad].map(|at| tracer.front(at));
        let middle = tracer.front(0.5 * (from_rad + to_rad));
        let hits = [&borders[0], &borders[1], &middle].map(|front| front.onto(circle));
        let least =
            |of: fn(&Front) -> f64| hits.iter().map(|hit| of(&hit.0)).fold(f64::MAX, f64::min);
        let spread = [least(|hit| hit.length_m), least(|hit| hit.width_m), least(|hit| hit.growth)];
        let strength = Strength::of(tube.gain, spread, self.radius_m, settings);
        let least_m = spread[0] + self.back_m(circle);
        let is_worth = strength.with(&tube.partner)
            >= settings.contact_floor(true, least_m).powi(2)
            || self.has_edges && self.is_worth_an_edge(tube.gain, spread, least_m);
        if !is_worth || least_m > settings.max_path_m {
            return None;
        }
        let near = hits[2].1.to_angle();
        let mut ends = [(hits[0], from_rad), (hits[1], to_rad)]
            .map(|(hit, at)| Contact::at(hit, circle, tube.mirrored, at, near));
        if !tube.mirrored {
            ends.reverse();
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
            least_m: spread[0],
            strength,
        })
    }
}

/// The parts of a tube that meet an arc.
///
/// The tube is cut at the rays that touch the circle, then the circle's lit angles (from contact to contact,
/// clockwise from the right border to the left one) at the ends of the arc, whose rays are found in turn.
fn met_spans(
    tube: &Tube,
    tracer: &Tracer,
    circle: &Circle,
    arc: &SurfaceArc,
) -> SmallVec<[Span; 2]> {
    let [right, left] = tube.in_order();
    let Span { from_rad, to_rad } = tube.span;
    let (r, center) = (circle.radius_m, circle.center);
    let is_beside = right.offset_m(center) <= -r || left.offset_m(center) >= r;
    if is_beside {
        return SmallVec::new();
    }
    // Where the rays touch the circle, its centre to their left and to their right.
    let touching = [(right, 1.0), (left, -1.0)].map(|(border, side)| {
        let beyond = side * border.offset_m(center) > r;
        let own = if std::ptr::eq(border, &tube.borders[0]) { from_rad } else { to_rad };
        if beyond { front_past(tube, tracer, center, side * r) } else { (own, *border) }
    });
    let ends = touching.each_ref().map(|ray| ray.0);
    // Their contacts: clockwise around the circle from right to left.
    let [first, last] = touching.map(|(_, front)| front.onto(circle).1.to_angle());
    let turn = (first - last).rem_euclid(TAU);
    let lit = Span { from_rad: last, to_rad: last + turn };
    lit.common(&arc.span)
        .into_iter()
        .map(|part| {
            let at = |angle: f64, end: f64, own: f64| {
                let point: DVec2 = circle.point(angle);
                if angle == own { end } else { ray_past(tube, tracer, point, 0.0) }
            };
            let one = at(part.from_rad, ends[1], lit.from_rad);
            let other = at(part.to_rad, ends[0], lit.to_rad);
            Span { from_rad: one.min(other), to_rad: one.max(other) }
        })
        .filter(|span| {
            let middle = tracer.front(0.5 * (span.from_rad + span.to_rad));
            span.to_rad > span.from_rad && middle.ahead_m(center) > 0.0
        })
        .collect()
}
