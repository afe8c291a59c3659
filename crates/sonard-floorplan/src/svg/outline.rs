//! Polygonal approximation of outlines.

use sonard_model::geometry::DVec2;
use usvg::tiny_skia_path::{Path as Outline, PathSegment, Point};

use crate::curve::MAX_CURVE_ERROR_M;

/// Minimum and maximum number of walls of a curve.
const MIN_CURVE_WALLS: usize = 4;
const MAX_CURVE_WALLS: usize = 256;

/// Page of a drawing, with its scale.
#[derive(Debug, Clone, Copy)]
pub(super) struct Page {
    /// Metres per unit.
    pub(super) scale: f64,
    /// Width and height, units.
    pub(super) width: f64,
    pub(super) height: f64,
}

/// Corners of a line in metres, and a flag for closed lines.
pub(super) type Polyline = (Vec<DVec2>, bool);

impl Page {
    /// Converts to the world, with y up.
    fn place(&self, point: Point) -> DVec2 {
        self.scale * DVec2::new(f64::from(point.x), self.height - f64::from(point.y))
    }

    /// Returns the lines of an outline; curves become short lines.
    pub(super) fn polylines(&self, outline: &Outline) -> Vec<Polyline> {
        let mut lines = Vec::new();
        let mut corners: Vec<DVec2> = Vec::new();
        let mut end = |corners: &mut Vec<DVec2>, is_closed: bool| {
            if !corners.is_empty() {
                lines.push((std::mem::take(corners), is_closed));
            }
        };
        let mut last = Point::zero();
        for segment in outline.segments() {
            match segment {
                PathSegment::MoveTo(to) => {
                    end(&mut corners, false);
                    corners.push(self.place(to));
                    last = to;
                }
                PathSegment::LineTo(to) => {
                    corners.push(self.place(to));
                    last = to;
                }
                PathSegment::QuadTo(by, to) => {
                    // Exact conversion to a cubic curve.
                    let third = |end: Point| mixed([end, by], [1.0 / 3.0, 2.0 / 3.0]);
                    self.curve(&mut corners, [last, third(last), third(to), to]);
                    last = to;
                }
                PathSegment::CubicTo(by, and, to) => {
                    self.curve(&mut corners, [last, by, and, to]);
                    last = to;
                }
                PathSegment::Close => end(&mut corners, true),
            }
        }
        end(&mut corners, false);
        lines
    }

    /// Approximates a Bezier curve by short lines. The deviation of `n` lines is at most
    /// `3 b / 4 n^2`, with the greatest second difference `b` of the control points (Wang).
    fn curve(&self, corners: &mut Vec<DVec2>, points: [Point; 4]) {
        let [a, b, c, d] = points.map(|point| self.place(point));
        let bend_m = (a - 2.0 * b + c).length().max((b - 2.0 * c + d).length());
        let parts = (0.75 * bend_m / MAX_CURVE_ERROR_M).sqrt().ceil();
        let parts = (parts as usize).clamp(MIN_CURVE_WALLS, MAX_CURVE_WALLS);
        corners.extend((1..=parts).map(|part| {
            let t = part as f32 / parts as f32;
            let s = 1.0 - t;
            self.place(mixed(points, [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]))
        }));
    }

    /// Returns `true` if a corner lies on the page, with a tolerance for rounding.
    pub(super) fn contains(&self, corner: DVec2) -> bool {
        let (size, tolerance) =
            (self.scale * DVec2::new(self.width, self.height), 1e-3 * self.scale * self.width);
        corner.cmpge(DVec2::splat(-tolerance)).all() && corner.cmple(size + tolerance).all()
    }
}

fn mixed<const N: usize>(points: [Point; N], shares: [f32; N]) -> Point {
    let sum = |of: fn(&Point) -> f32| {
        points.iter().zip(shares).map(|(point, share)| share * of(point)).sum()
    };
    Point::from_xy(sum(|point| point.x), sum(|point| point.y))
}
