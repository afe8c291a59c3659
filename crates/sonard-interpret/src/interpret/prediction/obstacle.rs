//! Intersection of beams with a predicted feature.

use super::{PredictedWall, SonarBeam};
use sonard_model::geometry::DVec2;

/// Predicted feature with the quantities that every beam needs precomputed.
pub(super) struct Obstacle<'a> {
    pub(super) line: &'a PredictedWall,
    /// Vector from the start to the end, metres.
    along: DVec2,
    /// Unit normal.
    normal: DVec2,
    /// Ends including the extension, metres.
    outer: [DVec2; 2],
    /// Extensions beyond both ends, relative to the length.
    beyond: [f64; 2],
}

impl<'a> Obstacle<'a> {
    /// Obstacles for the features of a map, with an optional extension of up to `extend_m` beyond
    /// their ends.
    pub(super) fn all(map: &'a [PredictedWall], extend_m: f64) -> Vec<Self> {
        map.iter().map(|line| Self::new(line, extend_m)).collect()
    }

    pub(super) fn new(line: &'a PredictedWall, extend_m: f64) -> Self {
        let along = line.b - line.a;
        let length_m = along.length().max(f64::MIN_POSITIVE);
        let beyond = line.max_extension_m.map(|max_m| extend_m.clamp(0.0, max_m) / length_m);
        let outer = [line.a - beyond[0] * along, line.b + beyond[1] * along];
        Self { line, along, normal: DVec2::from_angle(line.normal_rad), outer, beyond }
    }

    /// Cosine of the angle between a beam's axis and the normal, on either side.
    pub(super) fn cos_to(&self, axis: DVec2) -> f64 {
        self.normal.dot(axis).abs().min(1.0)
    }

    /// Distance from the ranger at which a beam's axis or side crosses the feature nearer than
    /// `far_m`, metres; `extended` includes the extensions.
    pub(super) fn crossing_m(&self, beam: &SonarBeam, far_m: f64, extended: bool) -> Option<f64> {
        // Most pairs of a beam and a feature miss; this rejects nearly all of them early.
        let [_, right, left] = beam.sides;
        let [start, end] = self.outer.map(|end| end - beam.from);
        let passes_right = right.perp_dot(start).max(right.perp_dot(end)) < 0.0;
        let passes_left = left.perp_dot(start).min(left.perp_dot(end)) > 0.0;
        if passes_right || passes_left {
            return None;
        }
        let beyond = if extended { self.beyond } else { [0.0; 2] };
        let distance = |direction: &DVec2| self.distance_m(beam.from, *direction, far_m, beyond);
        beam.sides.iter().filter_map(distance).min_by(f64::total_cmp)
    }

    /// Distance at which the beam's axis crosses the feature itself nearer than `far_m`, metres.
    pub(super) fn crossing_of_axis_m(&self, beam: &SonarBeam, far_m: f64) -> Option<f64> {
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
