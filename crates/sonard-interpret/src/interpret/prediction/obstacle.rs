//! A predicted feature as beams meet it.

use super::{Line, Ray};
use sonard_model::geometry::DVec2;

/// A feature with what every beam asks of it, worked out once.
pub(super) struct Obstacle<'a> {
    pub(super) line: &'a Line,
    /// From its one end to the other, metres.
    along: DVec2,
    /// Unit normal.
    normal: DVec2,
    /// Where it ends if it goes on beyond both ends, metres.
    outer: [DVec2; 2],
    /// Lengths by which it goes on beyond both ends, as parts of its own.
    beyond: [f64; 2],
}

impl<'a> Obstacle<'a> {
    /// The features of a map; beams may be asked for as if each went on beyond its ends by
    /// `extend_m`, as far as it may.
    pub(super) fn all(map: &'a [Line], extend_m: f64) -> Vec<Self> {
        map.iter().map(|line| Self::new(line, extend_m)).collect()
    }

    pub(super) fn new(line: &'a Line, extend_m: f64) -> Self {
        let along = line.b - line.a;
        let length_m = along.length().max(f64::MIN_POSITIVE);
        let beyond = line.may_go_on_m.map(|most_m| extend_m.clamp(0.0, most_m) / length_m);
        let outer = [line.a - beyond[0] * along, line.b + beyond[1] * along];
        Self { line, along, normal: DVec2::from_angle(line.normal_rad), outer, beyond }
    }

    /// Cosine of the angle between a beam's axis and the normal, on whichever side.
    pub(super) fn cos_to(&self, axis: DVec2) -> f64 {
        self.normal.dot(axis).abs().min(1.0)
    }

    /// Where a beam crosses it nearer than `far_m` along its axis or a side, metres from the
    /// ranger; `extended`: as if it went on beyond its ends.
    pub(super) fn crossing_m(&self, beam: &Ray, far_m: f64, extended: bool) -> Option<f64> {
        // Almost all pairs of a beam and a feature miss, and this tells most of them.
        let [_, right, left] = beam.sides;
        let [one, other] = self.outer.map(|end| end - beam.from);
        let passes_right = right.perp_dot(one).max(right.perp_dot(other)) < 0.0;
        let passes_left = left.perp_dot(one).min(left.perp_dot(other)) > 0.0;
        if passes_right || passes_left {
            return None;
        }
        let beyond = if extended { self.beyond } else { [0.0; 2] };
        let distance = |direction: &DVec2| self.distance_m(beam.from, *direction, far_m, beyond);
        beam.sides.iter().filter_map(distance).min_by(f64::total_cmp)
    }

    /// The same for the beam's axis alone.
    pub(super) fn crossing_of_axis_m(&self, beam: &Ray, far_m: f64) -> Option<f64> {
        self.distance_m(beam.from, beam.axis(), far_m, [0.0; 2])
    }

    fn distance_m(
        &self,
        from: DVec2,
        direction: DVec2,
        far_m: f64,
        [before, after]: [f64; 2],
    ) -> Option<f64> {
        let across = direction.perp_dot(self.along);
        let to_a = (self.line.a - from) * across.signum();
        let (distance, share) = (to_a.perp_dot(self.along), to_a.perp_dot(direction));
        let across = across.abs();
        let near = distance > 0.0 && distance < far_m * across;
        let within = (-before * across..=(1.0 + after) * across).contains(&share);
        (near && within).then(|| distance / across)
    }
}
