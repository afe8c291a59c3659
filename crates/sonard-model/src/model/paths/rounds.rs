//! Cylinders: where they stand in the mesh, and what they hide.

use std::f64::consts::{PI, TAU};

use smallvec::{SmallVec, smallvec};

use super::{
    beam::{Beam, TIE_M, reaches_well},
    mesh::Mesh,
    trace::View,
};
use crate::geometry::DVec2;

/// The cylinders of a scene and the triangles they reach into.
#[derive(Debug, Default)]
pub(super) struct Rounds {
    pub(super) circles: Vec<Circle>,
    /// By triangle; empty without cylinders.
    by_triangle: Vec<SmallVec<[Arc; 1]>>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Circle {
    pub(super) center: DVec2,
    pub(super) radius_m: f64,
    pub(super) gain: f64,
    /// Whether no sound passes above or below.
    pub(super) is_opaque: bool,
}

/// The part of a cylinder's surface that is in a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arc {
    pub(super) cylinder: u32,
    pub(super) span: Span,
}

/// Counter-clockwise from one angle to another, at most a turn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub(super) from_rad: f64,
    pub(super) to_rad: f64,
}

/// Spans shorter than this are empty, radians.
const LEAST_RAD: f64 = 1e-12;

impl Rounds {
    /// Finds the triangles of each.
    pub(super) fn new(circles: Vec<Circle>, mesh: Option<&Mesh>) -> Self {
        let mut by_triangle = Vec::new();
        if let Some(mesh) = mesh.filter(|_| !circles.is_empty()) {
            by_triangle.resize(mesh.triangles.len(), SmallVec::new());
            for (circle, cylinder) in circles.iter().zip(0..).filter(|(c, _)| c.radius_m > 0.0) {
                for triangle in mesh.triangles_near(circle.center, circle.radius_m) {
                    let spans = circle.spans_in(mesh, triangle);
                    let arcs = spans.into_iter().map(|span| Arc { cylinder, span });
                    by_triangle[triangle as usize].extend(arcs);
                }
            }
        }
        Self { circles, by_triangle }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.circles.is_empty()
    }

    pub(super) fn in_triangle(&self, triangle: u32) -> &[Arc] {
        self.by_triangle.get(triangle as usize).map_or(&[], |arcs| arcs)
    }

    /// What of a beam passes the cylinders in its triangle, from right to left. What they take
    /// from it goes to `views`.
    pub(super) fn shade(&self, beam: &Beam, views: &mut Vec<View>) -> SmallVec<[Beam; 2]> {
        let mut left = smallvec![*beam];
        let mut arcs: SmallVec<[Arc; 4]> = self.in_triangle(beam.triangle).into();
        // Of two circles that do not overlap, a ray meets the one first that has the smaller
        // power: the line of equal power lies between them.
        let power = |arc: &Arc| self.circles[arc.cylinder as usize].power(beam.image);
        arcs.sort_by(|one, other| power(one).total_cmp(&power(other)));
        for arc in &arcs {
            let circle = &self.circles[arc.cylinder as usize];
            left = left.iter().flat_map(|beam| circle.shade(beam, arc, views)).collect();
        }
        left
    }

    /// Whether a cylinder stands across the straight way between two points of a triangle.
    pub(super) fn hide_in(&self, triangle: u32, from: DVec2, to: DVec2) -> bool {
        let mut circles = self.in_triangle(triangle).iter().map(|arc| arc.cylinder as usize);
        circles.any(|at| self.circles[at].is_opaque && self.circles[at].meets(from, to))
    }
}

impl Span {
    /// What two spans have in common, in this one's turns.
    pub(super) fn common(&self, other: &Self) -> SmallVec<[Self; 2]> {
        let turn = ((self.from_rad - other.from_rad) / TAU).floor();
        [turn - 1.0, turn, turn + 1.0, turn + 2.0]
            .into_iter()
            .map(|turn| Self {
                from_rad: self.from_rad.max(other.from_rad + turn * TAU),
                to_rad: self.to_rad.min(other.to_rad + turn * TAU),
            })
            .filter(|common| common.to_rad - common.from_rad > LEAST_RAD)
            .collect()
    }
}

impl Circle {
    /// The point of the surface at an angle around the centre.
    pub(super) fn point(&self, angle_rad: f64) -> DVec2 {
        self.center + self.radius_m * DVec2::from_angle(angle_rad)
    }

    /// The square of the length of a tangent from a point.
    fn power(&self, point: DVec2) -> f64 {
        point.distance_squared(self.center) - self.radius_m * self.radius_m
    }

    /// What of a beam passes an arc of this circle, from right to left.
    fn shade(&self, beam: &Beam, arc: &Arc, views: &mut Vec<View>) -> SmallVec<[Beam; 2]> {
        let Some(lit) = self.lit_by(beam) else { return smallvec![*beam] };
        let mut passing = SmallVec::new();
        let mut rest = *beam;
        // From right to left places on the circle fall.
        for span in lit.common(&arc.span).into_iter().rev() {
            let [mut left, mut right] =
                [span.from_rad, span.to_rad].map(|at| self.point(at) - beam.image);
            if span.to_rad == lit.to_rad && !reaches_well(beam.right, right) {
                right = beam.right;
            }
            if span.from_rad == lit.from_rad && !reaches_well(left, beam.left) {
                left = beam.left;
            }
            if !reaches_well(right, left) {
                continue;
            }
            let beam = Beam { right, left, ..rest };
            views.push(View { cylinder: arc.cylinder, span, beam });
            if self.is_opaque {
                if reaches_well(rest.right, right) {
                    passing.push(Beam { left: right, ..rest });
                }
                rest.right = left;
            }
        }
        if reaches_well(rest.right, rest.left) {
            passing.push(rest);
        }
        passing
    }

    /// The part of the surface that a beam lights, as far as its triangle is not asked.
    fn lit_by(&self, beam: &Beam) -> Option<Span> {
        let to_image = beam.image - self.center;
        let sine = self.radius_m / to_image.length();
        if sine >= 1.0 {
            return None;
        }
        let edge = sine.asin();
        let off_axis = |border: DVec2| (-to_image).angle_to(border);
        let (mut right, mut left) = (off_axis(beam.right), off_axis(beam.left));
        if right > left {
            // The beam holds the direction away from the circle, and one side of it at most.
            if left > -edge { right -= TAU } else { left += TAU }
        }
        if right >= edge || left <= -edge {
            return None;
        }
        // A ray off the axis to the left meets the circle on the clockwise side of the image.
        let place = |off: f64| {
            let off = off.clamp(-edge, edge);
            off - (off.sin() / sine).clamp(-1.0, 1.0).asin()
        };
        let middle = to_image.to_angle();
        Some(Span { from_rad: middle + place(left), to_rad: middle + place(right) })
    }

    fn spans_in(&self, mesh: &Mesh, triangle: u32) -> SmallVec<[Span; 1]> {
        let mut cuts: SmallVec<[f64; 6]> = SmallVec::new();
        for side in 0..3 {
            let (a, b) = (mesh.corner(triangle, side), mesh.corner(triangle, (side + 1) % 3));
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
            return whole.then_some(Span { from_rad: -PI, to_rad: PI }).into_iter().collect();
        };
        let ends = cuts.iter().copied().skip(1).chain([first + TAU]);
        cuts.iter()
            .zip(ends)
            .map(|(&from_rad, to_rad)| Span { from_rad, to_rad })
            .filter(|span| mesh.holds(triangle, self.point(0.5 * (span.from_rad + span.to_rad))))
            .collect()
    }

    /// Between which shares of the straight way from one point to another it is inside.
    pub(super) fn chord(&self, from: DVec2, to: DVec2) -> Option<[f64; 2]> {
        let run = to - from;
        let middle = (self.center - from).dot(run) / run.length_squared();
        let offset_m = (from + middle * run).distance(self.center);
        let half_m = (self.radius_m * self.radius_m - offset_m * offset_m).max(0.0).sqrt();
        let half = half_m / run.length();
        let ends = [(middle - half).max(0.0), (middle + half).min(1.0)];
        (half_m > TIE_M && ends[0] < ends[1]).then_some(ends)
    }

    fn meets(&self, from: DVec2, to: DVec2) -> bool {
        let run = to - from;
        let nearest = ((self.center - from).dot(run) / run.length_squared()).clamp(0.0, 1.0);
        (from + nearest * run).distance(self.center) < self.radius_m - TIE_M
    }
}
