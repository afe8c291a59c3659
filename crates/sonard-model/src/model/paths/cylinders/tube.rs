//! A single tube and its rays.

use super::{
    departures::Departures,
    front::Front,
    partners::Partners,
    root::{End, zero_between},
    strength::Strength,
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
    /// Best partner that the tube's half-paths can be connected to.
    pub(crate) partner: Strength,
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

    /// Minimum over the borders.
    pub(crate) fn min_of(&self, of: impl Fn(&Front) -> f64) -> f64 {
        of(&self.borders[0]).min(of(&self.borders[1]))
    }
}

/// Splits a tube that has just hit a circle into parts that turn little.
pub(crate) fn split(
    tube: &Tube,
    tracer: &Tracer,
    circle: &PlanCircle,
    halvings: u32,
    partners: &Partners,
    waiting: &mut Vec<Tube>,
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
            split(&part, tracer, circle, halvings + 1, partners, waiting);
        }
    } else {
        let departures = Departures::between(tracer.departure(from_rad), tracer.departure(to_rad));
        waiting.push(Tube { partner: partners.best(&departures), ..*tube });
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

    #[test]
    fn cosines_match_the_angle() {
        let of = [0.7, 1.4].map(f64::cos);
        assert!(of.iter().zip(MAX_TURN_COSINES).all(|(a, b)| (a - b).abs() < 1e-15));
    }
}
