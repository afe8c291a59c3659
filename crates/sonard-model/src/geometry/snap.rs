//! Ends of segments brought to where they were meant to be.
//!
//! A floor plan drawn by hand or turned and written to some decimals has corners that gape, walls that stop
//! short of the one they join or run past it, and the same wall twice. Sound finds an opening of a nanometre as
//! well as one of a metre, so such a plan is made good first: ends near each other become one vertex, vertices
//! near a segment come to lie on it. Segments stay straight; what crosses or touches is cut later
//! ([`Arrangement`](super::Arrangement)).

mod joints;
mod square;
mod vertices;

use super::DVec2;
use joints::Joints;
use square::square_up;
pub use vertices::End;
use vertices::Vertices;

/// Moves below this are rounding of the arithmetic, metres.
const ROUNDING_M: f64 = 1e-12;

/// An end that was moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// The end.
    pub end: End,
    /// From where, metres.
    pub from: DVec2,
    /// To where, metres.
    pub to: DVec2,
    /// To make what good.
    pub cause: Cause,
}

/// The defect of a drawing that a move corrects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// It was apart from another end.
    Apart(End),
    /// It stopped short of a segment.
    Short(u32),
    /// It ran past a segment.
    Past(u32),
    /// A corner was a little off a right angle, or a segment's other end was moved.
    Turned,
}

/// Moves ends of segments by little more than `tolerance_m`, so that what was meant to meet does.
///
/// - Ends closer than the tolerance become one vertex, where their segments' lines meet if that is as near.
/// - Vertices closer than the tolerance to the inside of a segment come to lie on it, along their own line.
/// - If `is_squared`, corners of two segments become right-angled where a tenth of a millimetre does it.
///
/// A segment shorter than the tolerance stays, with both its ends. What comes out does not depend on the
/// segments' directions, and on their order only if two are the same. With a tolerance of 0 nothing is moved.
pub fn snap(segments: &mut [(DVec2, DVec2)], tolerance_m: f64, is_squared: bool) -> Vec<Move> {
    if tolerance_m <= 0.0 {
        return Vec::new();
    }
    let drawn = segments.to_vec();
    let mut vertices = Vertices::of(&drawn, tolerance_m);
    let joints = joints::find(&vertices, tolerance_m);
    if is_squared {
        square_up(&mut vertices, &joints, tolerance_m);
    }
    joints::close(&mut vertices, &joints, tolerance_m);
    let mut moves = Vec::new();
    for (index, (segment, was)) in segments.iter_mut().zip(&drawn).enumerate() {
        *segment = vertices.segment(index);
        if segment.0 == segment.1 {
            *segment = *was;
            continue;
        }
        for (at_b, from, to) in [(false, was.0, segment.0), (true, was.1, segment.1)] {
            if from.distance(to) > ROUNDING_M {
                let end = (index as u32, at_b);
                let cause = cause(&vertices, &joints, end);
                moves.push(Move { end, from, to, cause });
            }
        }
    }
    moves
}

fn cause(vertices: &Vertices, joints: &Joints, end: End) -> Cause {
    let vertex = vertices.vertex_of(end);
    if let Some(&through) = joints.of(vertex).first() {
        let (a, b) = vertices.drawn(through as usize);
        let side = |point: DVec2| (b - a).perp_dot(point - a);
        let here = vertices.drawn_end(end);
        let far = vertices.drawn_end((end.0, !end.1));
        let is_past = side(here) * side(far) < 0.0;
        return if is_past { Cause::Past(through) } else { Cause::Short(through) };
    }
    let here = vertices.drawn_end(end);
    let other =
        vertices.ends(vertex).map(|other| (vertices.drawn_end(other).distance(here), other));
    let farthest = other.filter(|(apart_m, _)| *apart_m > 0.0).max_by(|a, b| a.0.total_cmp(&b.0));
    farthest.map_or(Cause::Turned, |(_, other)| Cause::Apart(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A corner 0.04 mm off a right angle, one side of which is drawn as two of 10 m, three tenths of a nanometre off
    /// a line: rounding. The corner is made right with the whole side, and the point within it goes along.
    #[test]
    fn a_side_goes_on_through_a_point_within_it() {
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

    /// A bend of a micrometre is a bend, however short what follows it: the corner is one of three, not of two.
    #[test]
    fn a_bend_ends_a_side() {
        let bend = DVec2::new(0.01, 1e-6);
        let (end, corner, up) = (DVec2::ZERO, DVec2::new(0.02, 0.0), DVec2::new(0.02 + 4e-5, 5.0));
        let mut segments = [(end, bend), (bend, corner), (corner, up)];
        snap(&mut segments, 2e-4, true);
        let [(_, bend), (_, corner), (_, up)] = segments;
        let cosine = (bend - corner).normalize().dot((up - corner).normalize());
        assert!(cosine.abs() < 1e-9, "{cosine}");
    }
}
