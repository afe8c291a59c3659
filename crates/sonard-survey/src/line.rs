//! Lines on which walls may be.

use std::f64::consts::{FRAC_PI_2, PI};

use sonard_model::geometry::{DVec2, Pose, wrap_pi};

use crate::{bundle::SupportedFeature, feature::VirtualFeature};

/// Foot of a perpendicular echo on a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Foot {
    /// Index of the sweep.
    pub(crate) sweep: usize,
    /// Position along the line, metres.
    pub(crate) along_m: f64,
    /// Range of the echo, metres.
    pub(crate) range_m: f64,
}

/// Infinite line `n . x = distance_m` with what suggests walls on it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Line {
    pub(crate) normal_rad: f64,
    pub(crate) distance_m: f64,
    pub(crate) feet: Vec<Foot>,
    /// Positions of point features along the line, metres.
    pub(crate) points: Vec<f64>,
    /// Number of arcs that support it.
    pub(crate) support: usize,
}

impl Line {
    pub(crate) const fn new(normal_rad: f64, distance_m: f64) -> Self {
        Self { normal_rad, distance_m, feet: Vec::new(), points: Vec::new(), support: 0 }
    }

    /// Line through a point.
    pub(crate) fn through(normal_rad: f64, point: DVec2) -> Self {
        Self::new(normal_rad, point.dot(DVec2::from_angle(normal_rad)))
    }

    /// Line of a feature with the feet of its arcs; `None` for a point.
    pub(crate) fn of_feature(of: &SupportedFeature, poses: &[Pose]) -> Option<Self> {
        let VirtualFeature::Line { normal_rad, distance_m, .. } = of.feature else { return None };
        let mut line = Self::new(normal_rad, distance_m);
        line.support = of.arcs.len();
        let foot = |sweep: usize, range_m: f64| Foot {
            sweep,
            along_m: line.along_m(poses[sweep].position()),
            range_m,
        };
        line.feet = of.arcs.iter().map(|arc| foot(arc.sweep, arc.range_m)).collect();
        Some(line)
    }

    /// Unit normal.
    pub(crate) fn normal(&self) -> DVec2 {
        DVec2::from_angle(self.normal_rad)
    }

    /// Unit vector along the line, to the left of the normal.
    pub(crate) fn along(&self) -> DVec2 {
        self.normal().perp()
    }

    /// Position of a point along the line, metres.
    pub(crate) fn along_m(&self, point: DVec2) -> f64 {
        point.dot(self.along())
    }

    /// Signed distance of a point from the line, metres.
    pub(crate) fn off_m(&self, point: DVec2) -> f64 {
        point.dot(self.normal()) - self.distance_m
    }

    /// Point at a position along the line.
    pub(crate) fn at(&self, along_m: f64) -> DVec2 {
        self.distance_m * self.normal() + along_m * self.along()
    }

    /// Intersection with another line; `None` if they are within 8 degrees of parallel.
    pub(crate) fn meet(&self, other: &Self) -> Option<DVec2> {
        const MIN_SINE: f64 = 0.139;
        let (own, others) = (self.normal(), other.normal());
        let sine = own.perp_dot(others);
        let point = DVec2::new(
            self.distance_m * others.y - other.distance_m * own.y,
            other.distance_m * own.x - self.distance_m * others.x,
        ) / sine;
        (sine.abs() > MIN_SINE).then_some(point)
    }

    /// Angle between the lines, radians in [0, pi/2].
    pub(crate) fn angle_to(&self, other: &Self) -> f64 {
        let off_rad = wrap_pi(self.normal_rad - other.normal_rad).abs();
        off_rad.min(PI - off_rad)
    }

    /// Returns `true` if both lines are one near a place: within 2 degrees and `tolerance_m`.
    pub(crate) fn is_same(&self, other: &Self, near: DVec2, tolerance_m: f64) -> bool {
        const SAME_RAD: f64 = 0.035;
        let foot = near - self.off_m(near) * self.normal();
        self.angle_to(other) < SAME_RAD && other.off_m(foot).abs() < tolerance_m
    }

    /// Place at which the line is known best: the mean of its feet, else nearest to a place.
    pub(crate) fn anchor(&self, otherwise: DVec2) -> DVec2 {
        let known = if self.feet.is_empty() {
            self.points.clone()
        } else {
            self.feet.iter().map(|foot| foot.along_m).collect()
        };
        match known.len() {
            0 => self.at(self.along_m(otherwise)),
            count => self.at(known.iter().sum::<f64>() / count as f64),
        }
    }

    /// Line turned about its anchor.
    pub(crate) fn turned(&self, by_rad: f64, otherwise: DVec2, poses: &[Pose]) -> Self {
        let anchor = self.anchor(otherwise);
        let mut line = Self::through(self.normal_rad + by_rad, anchor);
        line.support = self.support;
        line.feet = self
            .feet
            .iter()
            .map(|foot| Foot { along_m: line.along_m(poses[foot.sweep].position()), ..*foot })
            .collect();
        line
    }

    /// Turns the line about the origin, then moves it.
    pub(crate) fn move_by(&mut self, turned_rad: f64, by: DVec2) {
        self.normal_rad += turned_rad;
        self.distance_m += by.dot(self.normal());
        let along_m = by.dot(self.along());
        self.feet.iter_mut().for_each(|foot| foot.along_m += along_m);
        self.points.iter_mut().for_each(|point_m| *point_m += along_m);
    }

    /// Recomputes the feet for changed poses.
    pub(crate) fn update_feet(&mut self, poses: &[Pose]) {
        let along = self.along();
        for foot in &mut self.feet {
            foot.along_m = poses[foot.sweep].position().dot(along);
        }
    }

    /// Notes the points that lie on the line, within 15 mm.
    pub(crate) fn attach_points(&mut self, points: &[(DVec2, usize)]) {
        const ON_M: f64 = 0.015;
        let on = points.iter().filter(|(point, _)| self.off_m(*point).abs() < ON_M);
        let mut found: Vec<f64> = on.map(|(point, _)| self.along_m(*point)).collect();
        found.sort_by(f64::total_cmp);
        self.points = found;
    }
}

/// Common axis of mostly square lines, radians modulo a quarter turn, weighted by support.
pub(crate) fn square_axis(lines: &[Line]) -> Option<f64> {
    let sum = lines.iter().fold(DVec2::ZERO, |sum, line| {
        sum + line.support.max(1) as f64 * DVec2::from_angle(4.0 * line.normal_rad)
    });
    (sum.length() > 1e-9).then(|| 0.25 * sum.to_angle())
}

/// Deviation of a direction from the nearest multiple of a quarter turn from an axis, radians.
pub(crate) fn off_square_rad(normal_rad: f64, axis_rad: f64) -> f64 {
    (normal_rad - axis_rad + 0.5 * FRAC_PI_2).rem_euclid(FRAC_PI_2) - 0.5 * FRAC_PI_2
}
