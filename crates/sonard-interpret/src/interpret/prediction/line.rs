//! Predicted feature: a straight section of wall.

use super::between_rad;
use sonard_model::geometry::{DVec2, wrap_pi};

/// Tolerance between normals of one wall, radians, for errors of the heading.
const NORMAL_TOLERANCE_RAD: f64 = 0.05;

/// Straight section of wall with the possible directions of its normal.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictedWall {
    /// Start point, metres.
    pub a: DVec2,
    /// End point, metres.
    pub b: DVec2,
    /// World direction of the normal away from the ranger, radians.
    pub normal_rad: f64,
    /// Half width of the possible directions of the normal, radians.
    pub spread_rad: f64,
    /// Number of supporting readings.
    pub support: f64,
    /// Position of the robot at the last detection.
    pub seen_from: DVec2,
    /// Maximum extension beyond `a` and `b`, metres: short where the wall was split for a missing
    /// echo, infinite where nothing is known.
    pub max_extension_m: [f64; 2],
    /// Readings of the current scan that belong to the feature, in ascending order.
    pub readings: Vec<u32>,
    /// Ranger position and mean range, for a feature of a single scan.
    reference: Option<(DVec2, f64)>,
}

impl PredictedWall {
    /// Feature of one reading, across its beam and as long as the beam is wide there (step 1); the
    /// normal may deviate from the beam's axis by `spread_rad`.
    pub(super) fn from_reading(
        (index, from, axis_rad, range_m): (u32, DVec2, f64, f64),
        half_rad: f64,
        spread_rad: f64,
    ) -> Self {
        let axis = DVec2::from_angle(axis_rad);
        let across = range_m * half_rad.tan() * axis.perp();
        let middle = from + range_m * axis;
        Self {
            a: middle - across,
            b: middle + across,
            normal_rad: axis_rad,
            spread_rad,
            support: 1.0,
            max_extension_m: [f64::INFINITY; 2],
            seen_from: from,
            readings: vec![index],
            reference: Some((from, range_m)),
        }
    }

    /// Length, metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.a.distance(self.b)
    }

    /// Returns `true` if a reading of the current scan belongs to the feature.
    pub(super) fn explains(&self, reading: u32) -> bool {
        self.readings.binary_search(&reading).is_ok()
    }

    /// Returns `true` if two features may be one wall: overlapping normals and close (step 2).
    pub(super) fn is_similar(&self, other: &Self, near_m: f64, gap_m: f64) -> bool {
        let apart_rad = between_rad(self.normal_rad, other.normal_rad);
        if apart_rad > self.spread_rad + other.spread_rad + NORMAL_TOLERANCE_RAD {
            return false;
        }
        let (normal_rad, _) = self.common_normal(other);
        let normal = DVec2::from_angle(normal_rad);
        if (self.offset_m(normal) - other.offset_m(normal)).abs() > near_m {
            return false;
        }
        let ([low, high], [other_low, other_high]) = (self.span(normal), other.span(normal));
        (other_low - high).max(low - other_high) <= gap_m
    }

    /// Merges `other` in: common directions of the normal, mean position, total length.
    pub(super) fn merge(&mut self, other: &Self) {
        let (normal_rad, spread_rad) = self.common_normal(other);
        let normal = DVec2::from_angle(normal_rad);
        let support = self.support + other.support;
        let mean = |one: f64, two: f64| (one * self.support + two * other.support) / support;
        let offset_m = mean(self.offset_m(normal), other.offset_m(normal));
        let ([low, high], [other_low, other_high]) = (self.span(normal), other.span(normal));
        self.reference = match (self.reference, other.reference) {
            (Some((from, one)), Some((_, two))) if self.seen_from == other.seen_from => {
                Some((from, mean(one, two)))
            }
            _ => None,
        };
        let place = |along_m: f64| offset_m * normal + along_m * normal.perp();
        let [start, end] = [low.min(other_low), high.max(other_high)];
        // Bounds on the extension apply to the whole, unless it was seen farther out.
        let min_m = (low - self.max_extension_m[0]).max(other_low - other.max_extension_m[0]);
        let max_m = (high + self.max_extension_m[1]).min(other_high + other.max_extension_m[1]);
        self.max_extension_m = [(start - min_m).max(0.0), (max_m - end).max(0.0)];
        (self.a, self.b) = (place(start), place(end));
        (self.normal_rad, self.spread_rad) = (normal_rad, spread_rad);
        self.support = support;
        self.seen_from = other.seen_from;
        self.readings.extend_from_slice(&other.readings);
        self.readings.sort_unstable();
    }

    /// Fixes the position, whatever direction the normal is refined to later.
    pub(super) fn fix(&mut self, robot: DVec2) {
        let normal = DVec2::from_angle(self.normal_rad);
        let (offset_m, [low, high]) = (self.offset_m(normal), self.span(normal));
        self.a = offset_m * normal + low * normal.perp();
        self.b = offset_m * normal + high * normal.perp();
        self.reference = None;
        self.seen_from = robot;
        // Bounded support keeps the feature adaptable without being overturned by a few readings.
        self.support = self.support.min(50.0);
    }

    /// Parts on both sides of a point, each shortened there and extensible by at most `end_m`.
    pub(super) fn split(&self, at: DVec2, shorten_m: f64, end_m: f64) -> [Self; 2] {
        let along = (self.b - self.a).normalize_or_zero();
        let part = |a: DVec2, b: DVec2, may_go_on_m: [f64; 2]| {
            let forward = (b - a).dot(along) > 0.0;
            let b = if forward { b } else { a };
            Self { a, b, max_extension_m: may_go_on_m, ..self.clone() }
        };
        let [before, after] = self.max_extension_m;
        [
            part(self.a, at - shorten_m * along, [before, end_m]),
            part(at + shorten_m * along, self.b, [end_m, after]),
        ]
    }

    /// Middle and half width of the common directions of both normals; the mean without overlap.
    fn common_normal(&self, other: &Self) -> (f64, f64) {
        let turn = wrap_pi(other.normal_rad - self.normal_rad);
        let low = (-self.spread_rad).max(turn - other.spread_rad);
        let high = self.spread_rad.min(turn + other.spread_rad);
        let middle = self.normal_rad + (low + high) / 2.0;
        (wrap_pi(middle), ((high - low) / 2.0).max(0.0))
    }

    /// Distance from the world's origin along a normal: the wall of an echo is at the echo's range
    /// along the wall's normal, whichever beam detected it.
    fn offset_m(&self, normal: DVec2) -> f64 {
        match self.reference {
            Some((from, range_m)) => normal.dot(from) + range_m,
            None => normal.dot(self.a + self.b) / 2.0,
        }
    }

    /// Interval covered across a normal, metres.
    fn span(&self, normal: DVec2) -> [f64; 2] {
        let along = normal.perp();
        let (a, b) = (along.dot(self.a), along.dot(self.b));
        [a.min(b), a.max(b)]
    }
}
