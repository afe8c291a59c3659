//! Cylinders, and the triangles they reach into.

use std::f64::consts::{PI, TAU};

use smallvec::SmallVec;

use super::mesh::Mesh;
use crate::{
    geometry::{DVec2, distance_to_segment},
    model::paths::tolerance::TIE_M,
};

/// Cylinders of a scene and the triangles they reach into.
#[derive(Debug, Default)]
pub(crate) struct Cylinders {
    pub(crate) circles: Vec<PlanCircle>,
    /// Arcs by triangle; empty without cylinders.
    by_triangle: Vec<SmallVec<[SurfaceArc; 1]>>,
    /// Lower bound of the way from each cylinder to the next one, over walls or not, metres.
    to_next_m: Vec<f64>,
}

/// A cylinder in the plan.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlanCircle {
    pub(crate) center: DVec2,
    /// Zero for a cylinder that is not at the ranger's height, so that the others keep their
    /// numbers.
    pub(crate) radius_m: f64,
    /// Amplitude of the mirror reflection.
    pub(crate) gain: f64,
    /// `true` if no sound passes above or below.
    pub(crate) is_opaque: bool,
}

/// Part of a cylinder's surface within a triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceArc {
    pub(crate) cylinder: u32,
    pub(crate) span: AngleSpan,
}

/// Interval of angles, counter-clockwise, at most a turn.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AngleSpan {
    pub(crate) from_rad: f64,
    pub(crate) to_rad: f64,
}

/// Number of cylinders from which on distances to the nearest one are not evaluated: they are
/// small, and each evaluation would compare all cylinders.
const MANY: usize = 5;

/// Length below which spans count as empty, radians.
const MIN_SPAN_RAD: f64 = 1e-12;

impl Cylinders {
    /// Assigns the arcs of all circles to triangles.
    pub(crate) fn new(circles: Vec<PlanCircle>, mesh: Option<&Mesh>) -> Self {
        let mut by_triangle = Vec::new();
        if let Some(mesh) = mesh.filter(|_| !circles.is_empty()) {
            by_triangle.resize(mesh.triangles.len(), SmallVec::new());
            for (circle, cylinder) in circles.iter().zip(0..).filter(|(c, _)| c.radius_m > 0.0) {
                let free = free_spans(&circles, cylinder);
                for triangle in mesh.triangles_near(circle.center, circle.radius_m) {
                    let spans = circle.spans_in(mesh, triangle);
                    let spans = spans
                        .iter()
                        .flat_map(|span| free.iter().flat_map(|free| span.common(free)));
                    let arcs = spans.map(|span| SurfaceArc { cylinder, span });
                    by_triangle[triangle as usize].extend(arcs);
                }
            }
        }
        let to_next_m = to_next_m(&circles, mesh);
        Self { circles, by_triangle, to_next_m }
    }

    /// Lower bound of the length that a ray runs from a cylinder to the next one, over walls or
    /// not, metres.
    pub(crate) fn to_next_m(&self, cylinder: u32) -> f64 {
        self.to_next_m.get(cylinder as usize).copied().unwrap_or_default()
    }

    /// Lower bound of the distance from a segment to the nearest cylinder, metres.
    pub(crate) fn distance_to_segment(&self, a: DVec2, b: DVec2) -> f64 {
        if self.circles.len() >= MANY {
            return 0.0;
        }
        let round = self.circles.iter().filter(|circle| circle.radius_m > 0.0);
        round.map(|circle| circle.distance_to_segment(a, b)).fold(f64::INFINITY, f64::min)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.circles.is_empty()
    }

    pub(crate) fn in_triangle(&self, triangle: u32) -> &[SurfaceArc] {
        self.by_triangle.get(triangle as usize).map_or(&[], |arcs| arcs)
    }

    /// Returns `true` if a cylinder blocks the straight line between two points of a triangle.
    pub(crate) fn hide_in(&self, triangle: u32, from: DVec2, to: DVec2) -> bool {
        let mut circles = self.in_triangle(triangle).iter().map(|arc| arc.cylinder as usize);
        circles.any(|at| self.circles[at].is_opaque && self.circles[at].is_crossed(from, to))
    }
}

/// Lower bound of the way from each circle to the next one: straight to another one, or to a wall
/// and back to the same. Zeros for many circles.
fn to_next_m(circles: &[PlanCircle], mesh: Option<&Mesh>) -> Vec<f64> {
    let Some(mesh) = mesh.filter(|_| circles.len() < MANY) else { return Vec::new() };
    let to_next_m = |(index, circle): (usize, &PlanCircle)| {
        let others =
            circles.iter().enumerate().filter(|(at, other)| *at != index && other.radius_m > 0.0);
        let to_other_m = |(_, other): (_, &PlanCircle)| {
            (circle.center.distance(other.center) - circle.radius_m - other.radius_m).max(0.0)
        };
        let by_walls = mesh.walls().map(|[a, b]| 2.0 * circle.distance_to_segment(a, b));
        others.map(to_other_m).chain(by_walls).fold(f64::INFINITY, f64::min)
    };
    circles.iter().enumerate().map(to_next_m).collect()
}

/// Parts of a circle that no opaque one covers. Of two identical circles the first one counts.
fn free_spans(circles: &[PlanCircle], number: u32) -> Vec<AngleSpan> {
    let circle = &circles[number as usize];
    let mut free = vec![AngleSpan { from_rad: -PI, to_rad: PI }];
    for (other, index) in circles.iter().zip(0..) {
        if index != number && other.is_opaque && other.radius_m > 0.0 {
            match circle.outside(other, index < number) {
                Some(outside) => {
                    free = free.iter().flat_map(|span| span.common(&outside)).collect();
                }
                None => return Vec::new(),
            }
        }
    }
    free
}

impl AngleSpan {
    /// Intersection of two spans, in the turns of `self`.
    pub(crate) fn common(&self, other: &Self) -> SmallVec<[Self; 2]> {
        let turn = ((self.from_rad - other.from_rad) / TAU).floor();
        [turn - 1.0, turn, turn + 1.0, turn + 2.0]
            .into_iter()
            .map(|turn| Self {
                from_rad: self.from_rad.max(other.from_rad + turn * TAU),
                to_rad: self.to_rad.min(other.to_rad + turn * TAU),
            })
            .filter(|common| common.to_rad - common.from_rad > MIN_SPAN_RAD)
            .collect()
    }
}

impl PlanCircle {
    /// Distance from the outside to a segment, 0 if they intersect, metres.
    fn distance_to_segment(&self, a: DVec2, b: DVec2) -> f64 {
        (distance_to_segment(self.center, a, b) - self.radius_m).max(0.0)
    }

    /// Returns the point of the surface at an angle around the centre.
    pub(crate) fn point(&self, angle_rad: f64) -> DVec2 {
        self.center + self.radius_m * DVec2::from_angle(angle_rad)
    }

    /// Power of a point: the square of the length of a tangent from it.
    pub(crate) fn power(&self, point: DVec2) -> f64 {
        point.distance_squared(self.center) - self.radius_m * self.radius_m
    }

    /// Part that is outside another circle, `None` if none is. Of two identical circles the one
    /// that `yields` is covered.
    fn outside(&self, other: &Self, yields: bool) -> Option<AngleSpan> {
        let apart = other.center - self.center;
        let apart_m = apart.length();
        if apart_m <= other.radius_m - self.radius_m {
            let is_same = apart_m == 0.0 && other.radius_m == self.radius_m;
            return (is_same && !yields).then_some(AngleSpan { from_rad: -PI, to_rad: PI });
        }
        if apart_m >= self.radius_m + other.radius_m || apart_m <= self.radius_m - other.radius_m {
            return Some(AngleSpan { from_rad: -PI, to_rad: PI });
        }
        // By the law of cosines, to the intersections of both.
        let (r, reach) = (self.radius_m, other.radius_m);
        let half_rad = ((apart_m * apart_m + r * r - reach * reach) / (2.0 * apart_m * r)).acos();
        let middle = apart.to_angle();
        Some(AngleSpan { from_rad: middle + half_rad, to_rad: middle - half_rad + TAU })
    }

    fn spans_in(&self, mesh: &Mesh, triangle: u32) -> SmallVec<[AngleSpan; 1]> {
        let mut cuts: SmallVec<[f64; 6]> = SmallVec::new();
        for side in 0..3 {
            let [a, b] = mesh.side(triangle, side);
            let along = (b - a).normalize();
            let foot = (self.center - a).dot(along);
            let height = along.perp_dot(self.center - a);
            let half_chord = self.radius_m * self.radius_m - height * height;
            if half_chord > 0.0 {
                let ends = [foot - half_chord.sqrt(), foot + half_chord.sqrt()];
                let on_side = ends.into_iter().filter(|end| (0.0..=a.distance(b)).contains(end));
                cuts.extend(on_side.map(|end| (a + end * along - self.center).to_angle()));
            }
        }
        cuts.sort_by(f64::total_cmp);
        let Some(&first) = cuts.first() else {
            let whole = mesh.holds(triangle, self.point(0.0));
            return whole.then_some(AngleSpan { from_rad: -PI, to_rad: PI }).into_iter().collect();
        };
        let ends = cuts.iter().copied().skip(1).chain([first + TAU]);
        cuts.iter()
            .zip(ends)
            .map(|(&from_rad, to_rad)| AngleSpan { from_rad, to_rad })
            .filter(|span| mesh.holds(triangle, self.point(0.5 * (span.from_rad + span.to_rad))))
            .collect()
    }

    /// Interval inside the circle, as shares of the straight line from one point to another.
    pub(crate) fn chord(&self, from: DVec2, to: DVec2) -> Option<[f64; 2]> {
        let run = to - from;
        let middle = (self.center - from).dot(run) / run.length_squared();
        let offset_m = (from + middle * run).distance(self.center);
        let half_m = (self.radius_m * self.radius_m - offset_m * offset_m).max(0.0).sqrt();
        let half = half_m / run.length();
        let ends = [(middle - half).max(0.0), (middle + half).min(1.0)];
        (half_m > TIE_M && ends[0] < ends[1]).then_some(ends)
    }

    fn is_crossed(&self, from: DVec2, to: DVec2) -> bool {
        let run = to - from;
        let nearest = ((self.center - from).dot(run) / run.length_squared()).clamp(0.0, 1.0);
        (from + nearest * run).distance(self.center) < self.radius_m - TIE_M
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn circle(x: f64, y: f64, radius_m: f64) -> PlanCircle {
        PlanCircle { center: DVec2::new(x, y), radius_m, gain: 1.0, is_opaque: true }
    }

    /// Total length of the free parts, and a test whether a direction is in one.
    fn free(circles: &[PlanCircle], number: u32) -> (f64, impl Fn(f64) -> bool) {
        let spans = free_spans(circles, number);
        let length_rad = spans.iter().map(|span| span.to_rad - span.from_rad).sum();
        let holds = move |angle: f64| {
            let within = |span: &AngleSpan| {
                (angle - span.from_rad).rem_euclid(TAU) < span.to_rad - span.from_rad
            };
            spans.iter().any(within)
        };
        (length_rad, holds)
    }

    /// Two circles of radius 1 whose centres are the root of 2 apart cross at 45 degrees off the
    /// line between them: a quarter of each is inside the other.
    #[test]
    fn overlapping_cylinders() {
        let pair = [circle(1.0, 1.0, 1.0), circle(2.0, 2.0, 1.0)];
        for (number, covered_rad) in [(0, PI / 4.0), (1, -0.75 * PI)] {
            let (length_rad, holds) = free(&pair, number);
            assert!((length_rad - 1.5 * PI).abs() < 1e-9, "{length_rad}");
            for off_rad in [0.0, 0.7, -0.7] {
                assert!(!holds(covered_rad + off_rad), "{number} {off_rad}");
            }
            for off_rad in [0.9, -0.9, PI] {
                assert!(holds(covered_rad + off_rad), "{number} {off_rad}");
            }
        }
        // Circles of different radii: 3, 4 and 5 form a right angle where they cross.
        let unlike = [circle(0.0, 0.0, 3.0), circle(5.0, 0.0, 4.0)];
        let half_rad = (3.0_f64 / 5.0).acos();
        assert!((free(&unlike, 0).0 - (TAU - 2.0 * half_rad)).abs() < 1e-9);
        assert!((free(&unlike, 1).0 - (TAU - 2.0 * (FRAC_PI_2 - half_rad))).abs() < 1e-9);
    }

    #[test]
    fn disjoint_and_nested_cylinders() {
        let whole = |circles: &[PlanCircle], number| (free(circles, number).0 - TAU).abs() < 1e-9;
        let apart = [circle(0.0, 0.0, 1.0), circle(3.0, 0.0, 1.0)];
        assert!(whole(&apart, 0) && whole(&apart, 1));
        let within = [circle(0.0, 0.0, 1.0), circle(0.2, 0.0, 0.5)];
        assert!(whole(&within, 0) && free(&within, 1).0 == 0.0);
        // Of two identical circles the first counts; one that lets sound pass or has no size covers
        // nothing.
        let same = [circle(0.0, 0.0, 1.0), circle(0.0, 0.0, 1.0)];
        assert!(whole(&same, 0) && free(&same, 1).0 == 0.0);
        let low = PlanCircle { is_opaque: false, ..circle(1.0, 0.0, 1.0) };
        assert!(whole(&[circle(0.0, 0.0, 1.0), low, circle(0.5, 0.0, 0.0)], 0));
    }

    #[test]
    fn tangents_and_chords() {
        let round = circle(1.0, 2.0, 3.0);
        // A tangent of 4 from 5 away; from inside the power is negative.
        assert_eq!(round.power(DVec2::new(6.0, 2.0)), 16.0);
        assert_eq!(round.power(DVec2::new(1.0, 1.0)), -8.0);
        // 10 long at 2.4 from the middle: half the chord is 1.8, about its middle.
        let chord = round.chord(DVec2::new(-4.0, 4.4), DVec2::new(6.0, 4.4)).expect("it cuts");
        assert!((chord[0] - 0.32).abs() < 1e-12 && (chord[1] - 0.68).abs() < 1e-12, "{chord:?}");
        assert_eq!(round.chord(DVec2::new(-4.0, 5.1), DVec2::new(6.0, 5.1)), None);
        assert_eq!(round.chord(DVec2::new(4.5, 2.0), DVec2::new(6.0, 2.0)), None);
    }
}
