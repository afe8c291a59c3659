//! Snapping of segment ends to their intended positions.
//!
//! Floor plans drawn by hand, or rotated and rounded, have open corners, walls that stop short of
//! the wall they join or run past it, and duplicate walls. Acoustically a gap of a nanometre is as
//! open as one of a metre. Such a plan is therefore repaired first: ends near each other become one
//! vertex, and vertices near a segment are moved onto it. Segments stay straight; crossings and
//! contacts are split later ([`Arrangement`](super::Arrangement)).

mod joints;
mod square;
mod vertices;

use super::DVec2;
use joints::Joints;
use square::square_up;
pub use vertices::SegmentEnd;
use vertices::Vertices;

/// Moves below this are rounding errors, metres.
const ROUNDING_M: f64 = 1e-12;

/// Correction of a segment end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SnapMove {
    /// Segment end that was moved.
    pub end: SegmentEnd,
    /// Position as drawn, metres.
    pub from: DVec2,
    /// Position after the correction, metres.
    pub to: DVec2,
    /// Defect that was corrected.
    pub cause: SnapCause,
}

/// Defect of a drawing that a move corrects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SnapCause {
    /// Gap to another end.
    Apart(SegmentEnd),
    /// End short of a segment.
    Short(u32),
    /// End past a segment.
    Past(u32),
    /// Corner slightly off a right angle, or the segment's other end was moved.
    Turned,
}

/// Moves segment ends by little more than `tolerance_m`, so that walls join as intended.
///
/// - Ends closer than the tolerance become one vertex, at the intersection of their segments' lines
///   if that is within the tolerance.
/// - Vertices closer than the tolerance to the inside of a segment are moved onto it, along their
///   own line.
/// - If `is_squared`, corners of two segments are made right-angled where a tenth of a millimetre
///   suffices.
///
/// A segment shorter than the tolerance keeps both its ends. The result does not depend on the
/// segments' directions, and on their order only for duplicates. With a tolerance of 0 nothing is
/// moved.
pub fn snap(segments: &mut [(DVec2, DVec2)], tolerance_m: f64, is_squared: bool) -> Vec<SnapMove> {
    if tolerance_m <= 0.0 {
        return Vec::new();
    }
    let drawn = segments.to_vec();
    let mut vertices = Vertices::from_segments(&drawn, tolerance_m);
    let joints = joints::find(&vertices, tolerance_m);
    if is_squared {
        square_up(&mut vertices, &joints, tolerance_m);
    }
    joints::close(&mut vertices, &joints, tolerance_m);
    let mut moves = Vec::new();
    for (index, (segment, original)) in segments.iter_mut().zip(&drawn).enumerate() {
        *segment = vertices.segment(index);
        if segment.0 == segment.1 {
            *segment = *original;
            continue;
        }
        for (at_b, from, to) in [(false, original.0, segment.0), (true, original.1, segment.1)] {
            if from.distance(to) > ROUNDING_M {
                let end = (index as u32, at_b);
                let cause = cause(&vertices, &joints, end);
                moves.push(SnapMove { end, from, to, cause });
            }
        }
    }
    moves
}

fn cause(vertices: &Vertices, joints: &Joints, end: SegmentEnd) -> SnapCause {
    let vertex = vertices.vertex_of(end);
    if let Some(&through) = joints.segments_at(vertex).first() {
        let (a, b) = vertices.drawn(through as usize);
        let side = |point: DVec2| (b - a).perp_dot(point - a);
        let here = vertices.drawn_end(end);
        let far = vertices.drawn_end((end.0, !end.1));
        let is_past = side(here) * side(far) < 0.0;
        return if is_past { SnapCause::Past(through) } else { SnapCause::Short(through) };
    }
    let here = vertices.drawn_end(end);
    let other =
        vertices.ends(vertex).map(|other| (vertices.drawn_end(other).distance(here), other));
    let farthest = other.filter(|(apart_m, _)| *apart_m > 0.0).max_by(|a, b| a.0.total_cmp(&b.0));
    farthest.map_or(SnapCause::Turned, |(_, other)| SnapCause::Apart(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corner 0.04 mm off a right angle, one side of which consists of two segments of 10 m that
    /// are collinear to 0.3 nm (rounding). The corner is squared with the whole side, and the inner
    /// vertex moves with it.
    #[test]
    fn side_spans_collinear_segments() {
        let middle = DVec2::new(0.0, 3e-10);
        let (end, corner, up) =
            (DVec2::new(-10.0, 0.0), DVec2::new(10.0, 0.0), DVec2::new(10.00004, 5.0));
        let mut segments = [(end, middle), (middle, corner), (corner, up)];
        snap(&mut segments, 2e-3, true);
        let [(end, middle), (again, corner), (_, up)] = segments;
        assert_eq!(middle, again);
        let cosine = (end - corner).normalize().dot((up - corner).normalize());
        assert!(cosine.abs() < 1e-12, "{cosine}");
        let off_m = (corner - end).normalize().perp_dot(middle - end);
        assert!(off_m.abs() < 1e-9, "{off_m}");
    }

    /// A bend of a micrometre ends a side, however short the next segment: the corner has three
    /// segments, not two.
    #[test]
    fn bend_ends_a_side() {
        let bend = DVec2::new(0.01, 1e-6);
        let (end, corner, up) = (DVec2::ZERO, DVec2::new(0.02, 0.0), DVec2::new(0.02 + 4e-5, 5.0));
        let mut segments = [(end, bend), (bend, corner), (corner, up)];
        snap(&mut segments, 2e-4, true);
        let [(_, bend), (_, corner), (_, up)] = segments;
        let cosine = (bend - corner).normalize().dot((up - corner).normalize());
        assert!(cosine.abs() < 1e-9, "{cosine}");
    }
}
