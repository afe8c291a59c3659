//! A single tube and its rays.

use super::{
    departures::Departures,
    front::Front,
    partners::{Partners, PartnersByLength},
    root::{End, zero_between},
    tracer::Tracer,
};
use crate::{
    geometry::DVec2,
    model::paths::{
        floor::{AngleSpan, PlanCircle},
        tolerance::TIE_M,
    },
};

/// Accuracy of rays to edges and of borders between tubes, metres: far below the width of a tie.
const EXACT_M: f64 = 1e-12;

/// A tube's part of a cylinder is split until it turns the rays by no more than twice 0.7 radians.
/// The values are the cosines of that angle and of twice that angle.
const MAX_TURN_COSINES: [f64; 2] = [0.764_842_187_284_488_5, 0.169_967_142_900_241];

/// Maximum number of halvings of a tube at a cylinder; rays closer to grazing are too weak.
const MAX_HALVINGS: u32 = 12;

/// Rays between two border rays, all reflected by the same surfaces.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tube {
    pub(crate) view: u32,
    pub(crate) link: u32,
    /// Contacts of the borders with the first cylinder, in increasing order.
    pub(crate) span: AngleSpan,
    /// Borders as they leave the last surface, in the same order.
    pub(crate) borders: [Front; 2],
    /// Ray in the middle of the contacts, if computed.
    pub(crate) middle: Option<Front>,
    /// `true` if the ray at `from_rad` is the left border.
    pub(crate) mirrored: bool,
    pub(crate) triangle: u32,
    /// Side through which the tube entered, `None` if it started here.
    pub(crate) side: Option<u8>,
    pub(crate) gain: f64,
    pub(crate) order: u16,
    /// Number of cylinders touched.
    pub(crate) level: u16,
    /// Number of the best partners that the tube's half-paths can be connected to, in
    /// [`TubeGrower`](super::grow::TubeGrower).
    pub(crate) partners: u32,
    /// Lower bound of the length of its rays up to its last cylinder, metres.
    pub(crate) min_m: f64,
    /// Lower bound of the length from there to the next cylinder, metres.
    pub(crate) to_next_m: f64,
}

impl Tube {
    /// Borders, the right one first.
    pub(crate) fn in_order(&self) -> [&Front; 2] {
        let [from, to] = &self.borders;
        if self.mirrored { [to, from] } else { [from, to] }
    }

    pub(crate) fn halves(&self, at_rad: f64, front: Front) -> [Self; 2] {
        let AngleSpan { from_rad, to_rad } = self.span;
        let [from, to] = self.borders;
        let part = |from_rad, to_rad, borders| Self {
            span: AngleSpan { from_rad, to_rad },
            borders,
            middle: None,
            ..*self
        };
        [part(from_rad, at_rad, [from, front]), part(at_rad, to_rad, [front, to])]
    }
}

/// Minima of length, width and growth over some rays.
pub(crate) fn min_spread(rays: &[Front]) -> [f64; 3] {
    let min = |of: fn(&Front) -> f64| rays.iter().map(of).fold(f64::INFINITY, f64::min);
    [min(|ray| ray.length_m), min(|ray| ray.width_m), min(|ray| ray.growth)]
}

/// Length, width and growth after a further distance, metres.
pub(crate) fn advanced([length_m, width_m, growth]: [f64; 3], distance_m: f64) -> [f64; 3] {
    [length_m + distance_m, width_m + growth * distance_m, growth]
}

/// Lower bound of the length of all rays of a convex front to the line between the origins of two
/// border rays, metres.
///
/// Along a straight line the length is a convex function of the position, with the direction of the
/// ray as its gradient. It therefore lies above its tangents at both borders.
pub(crate) fn min_length_m([from, to]: [&Front; 2]) -> f64 {
    let across = to.origin - from.origin;
    let slopes = [from.along.dot(across), to.along.dot(across)];
    min_of_convex([from.length_m, to.length_m], slopes)
}

/// Lower bound of a convex function on an interval of length 1, from values and slopes at its ends.
pub(crate) fn min_of_convex(values: [f64; 2], slopes: [f64; 2]) -> f64 {
    if slopes[0] >= 0.0 {
        return values[0];
    }
    if slopes[1] <= 0.0 {
        return values[1];
    }
    let share = (values[1] - slopes[1] - values[0]) / (slopes[0] - slopes[1]);
    values[0] + slopes[0] * share.clamp(0.0, 1.0)
}

/// Splits a tube that has just hit a circle into parts that turn little. Adds them to `waiting`,
/// and the partners of each to `found`.
pub(crate) fn split(
    tube: &Tube,
    tracer: &Tracer,
    circle: &PlanCircle,
    halvings: u32,
    partners: &Partners,
    (waiting, found): (&mut Vec<Tube>, &mut Vec<PartnersByLength>),
) {
    let [from, to] = tube.borders;
    let middle = |front: &Front| front.origin - circle.center;
    let is_wider = |a: DVec2, b: DVec2, cosine: f64| {
        a.dot(b) < cosine * (a.length_squared() * b.length_squared()).sqrt()
    };
    let turns = is_wider(middle(&from), middle(&to), MAX_TURN_COSINES[0]);
    let is_wide = turns || is_wider(from.along, to.along, MAX_TURN_COSINES[1]);
    let AngleSpan { from_rad, to_rad } = tube.span;
    if halvings < MAX_HALVINGS && is_wide {
        let half = 0.5 * (from_rad + to_rad);
        for part in tube.halves(half, tracer.front(half)) {
            split(&part, tracer, circle, halvings + 1, partners, (&mut *waiting, &mut *found));
        }
    } else {
        let departures = Departures::between(tracer.departure(from_rad), tracer.departure(to_rad));
        waiting.push(Tube { partners: found.len() as u32, ..*tube });
        found.push(partners.best(&departures));
    }
}

/// Contact of the ray that passes a point at `offset_m` to its right.
///
/// The offset of a point is monotone in the contact, because rays of a tube never cross. Its slope
/// is the distance between neighbouring rays next to the point, `width + growth * ahead`, times the
/// angle between them at departure per angle between their contacts (`departure_per_contact`).
pub(crate) fn ray_past(tube: &Tube, tracer: &Tracer, point: DVec2, offset_m: f64) -> f64 {
    front_past(tube, tracer, point, offset_m).0
}

/// As [`ray_past`], together with the ray.
pub(crate) fn front_past(
    tube: &Tube,
    tracer: &Tracer,
    point: DVec2,
    offset_m: f64,
) -> (f64, Front) {
    let AngleSpan { from_rad, to_rad } = tube.span;
    let [from, to] = &tube.borders;
    // Farther along the first contact's surface a ray is farther to the left.
    let sense = if tube.mirrored { 1.0 } else { -1.0 };
    let passes = |front: &Front| {
        let width_m = front.width_m + front.growth * front.ahead_m(point);
        (front.offset_m(point) - offset_m, sense * front.departure_per_contact * width_m)
    };
    let end = |at: f64, front: &Front| {
        let (value, slope) = passes(front);
        End { at, value, slope }
    };
    let mut last = (from_rad, *from);
    let at = zero_between([end(from_rad, from), end(to_rad, to)], EXACT_M, |at| {
        let front = tracer.front(at);
        last = (at, front);
        passes(&front)
    });
    let front = if at == last.0 {
        last.1
    } else if at == to_rad {
        *to
    } else {
        tracer.front(at)
    };
    (at, front)
}

/// Ray of the tube through a point; `None` if the point is outside the tube.
pub(crate) fn ray_through(tube: &Tube, tracer: &Tracer, point: DVec2) -> Option<(f64, Front)> {
    let [right, left] = tube.in_order();
    let is_between = right.offset_m(point) >= -TIE_M && left.offset_m(point) <= TIE_M;
    if !is_between {
        return None;
    }
    let (at, front) = front_past(tube, tracer, point, 0.0);
    (front.ahead_m(point) > 0.0).then_some((at, front))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays from a point to a line: the nearest is shorter than those at the borders.
    #[test]
    fn length_bound_holds_between_borders() {
        let crossing = |at: f64| {
            let origin = DVec2::new(at, 1.0);
            let length_m = origin.length();
            let (width_m, growth, departure_per_contact) = (length_m, 1.0, 1.0);
            let along = origin / length_m;
            Front { origin, along, length_m, width_m, growth, departure_per_contact }
        };
        for (from, to) in [(-0.5, 0.4), (0.2, 0.7), (-0.9, -0.1), (0.3, -0.3), (0.1, 0.1)] {
            let bound_m = min_length_m([&crossing(from), &crossing(to)]);
            let share = |step: i32| from + (to - from) * f64::from(step) / 100.0;
            let min_m =
                (0..=100).map(|step| crossing(share(step)).length_m).fold(f64::MAX, f64::min);
            assert!(bound_m <= min_m && bound_m > min_m - 0.15, "{from} to {to}: {bound_m}");
        }
    }

    #[test]
    fn cosines_match_the_angle() {
        let of = [0.7, 1.4].map(f64::cos);
        assert!(of.iter().zip(MAX_TURN_COSINES).all(|(a, b)| (a - b).abs() < 1e-15));
    }
}
