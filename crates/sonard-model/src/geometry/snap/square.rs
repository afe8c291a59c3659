//! Correction of corners to right angles.

use smallvec::SmallVec;

use super::{
    ROUNDING_M,
    joints::Joints,
    vertices::{SegmentEnd, Vertices},
};
use crate::geometry::DVec2;

/// Maximum move of a corner, metres: the effect of rounding to tenths of a millimetre.
const MAX_MOVE_M: f64 = 1e-4;

/// Moves below this are rounding errors, metres.
const MIN_MOVE_M: f64 = 1e-13;

/// Maximum offset of collinear segments, metres: rounding error.
const STRAIGHT_M: f64 = 1e-9;

/// Maximum number of rounds. Moving one corner rotates the neighbouring sides. Each round halves
/// the error in a rectangle, and reduces it by a fraction 2 pi^2 / n^2 in a ring of n corners.
const MAX_ROUNDS: usize = 500;

/// Fraction of the correction applied per round. All corners move simultaneously, so that their
/// order is irrelevant; the full correction would make a parallelogram oscillate.
const SHARE: f64 = 0.5;

/// Maximum number of collinear segments of a side.
const MAX_SEGMENTS: usize = 1000;

/// Corner of two sides, each extended over collinear segments.
struct SideCorner {
    vertex: u32,
    /// Far ends of the two sides.
    far: [u32; 2],
}

/// Vertex within a side, at a fraction of its length.
struct InnerVertex {
    vertex: u32,
    ends: [u32; 2],
    share: f64,
}

/// Squares corners of two sides where a move of 0.1 mm or less suffices. A side extends over
/// collinear segments, so that the subdivision of a wall is irrelevant; its joints are moved onto
/// its line.
///
/// A rotated corner rounded to a tenth of a millimetre may have 90.003 degrees. The difference is
/// inaudible but changes the mirror images: above 90 degrees no ray returns via both walls, below
/// it two do.
pub(super) fn square_up(vertices: &mut Vertices, joints: &Joints, max_move_m: f64) {
    let max_move_m = max_move_m.min(MAX_MOVE_M);
    let (corners, inner) = sides(vertices, joints);
    for _ in 0..MAX_ROUNDS {
        let off = |corner: &SideCorner| {
            let at = vertices.at[corner.vertex as usize];
            let [a, b] = corner.far.map(|far| vertices.at[far as usize]);
            let off = right_angled(at, a, b) - at;
            (MIN_MOVE_M..=max_move_m).contains(&off.length()).then_some((corner.vertex, off))
        };
        let moves: Vec<(u32, DVec2)> = corners.iter().filter_map(off).collect();
        if moves.is_empty() {
            break;
        }
        for (vertex, off) in moves {
            vertices.at[vertex as usize] += SHARE * off;
        }
    }
    for InnerVertex { vertex, ends, share } in &inner {
        let [a, b] = ends.map(|end| vertices.at[end as usize]);
        let (at, straight) = (&mut vertices.at[*vertex as usize], a.lerp(b, *share));
        if at.distance(straight) > ROUNDING_M {
            *at = straight;
        }
    }
}

/// Corners of two sides, and vertices within sides.
fn sides(vertices: &Vertices, joints: &Joints) -> (Vec<SideCorner>, Vec<InnerVertex>) {
    let (mut corners, mut inner) = (Vec::new(), Vec::new());
    for vertex in 0..vertices.len() as u32 {
        let ends: SmallVec<[SegmentEnd; 4]> = vertices.ends(vertex).collect();
        let is_through = ends.iter().any(|&end| straight_on(vertices, end).is_some());
        match ends[..] {
            [first, second]
                if !is_through && joints.segments_at(vertex).is_empty() && first.0 != second.0 =>
            {
                corners.push(SideCorner {
                    vertex,
                    far: [first, second].map(|end| far_end(vertices, end)),
                });
            }
            _ => {
                let through = ends.iter().find_map(|&end| Some((end, straight_on(vertices, end)?)));
                inner.extend(through.map(|(end, next)| {
                    let ends = [end, next].map(|end| far_end(vertices, end));
                    let [at, a, b] = [vertex, ends[0], ends[1]].map(|v| vertices.at[v as usize]);
                    InnerVertex { vertex, ends, share: a.distance(at) / a.distance(b) }
                }));
            }
        }
    }
    (corners, inner)
}

/// Far vertex of the side that begins with this end of a segment.
fn far_end(vertices: &Vertices, start: SegmentEnd) -> u32 {
    let mut end = start;
    for _ in 0..MAX_SEGMENTS {
        let Some(next) = straight_on(vertices, (end.0, !end.1)) else { break };
        end = next;
    }
    vertices.opposite(end)
}

/// Next end of a collinear segment at this end.
fn straight_on(vertices: &Vertices, end: SegmentEnd) -> Option<SegmentEnd> {
    let vertex = vertices.vertex_of(end);
    let (at, from) = (vertices.at[vertex as usize], vertices.at[vertices.opposite(end) as usize]);
    let is_straight = |next: &SegmentEnd| {
        let to = vertices.at[vertices.opposite(*next) as usize];
        let (before, after) = (at - from, to - at);
        let off_m = before.perp_dot(after).abs() / (to - from).length();
        before.dot(after) > 0.0 && off_m < STRAIGHT_M
    };
    vertices.ends(vertex).filter(|next| *next != end).find(is_straight)
}

/// Point nearest to `corner` from which `a` and `b` appear at a right angle: on Thales' circle.
fn right_angled(corner: DVec2, a: DVec2, b: DVec2) -> DVec2 {
    let (middle, radius) = (0.5 * (a + b), 0.5 * a.distance(b));
    middle + radius * (corner - middle).normalize_or_zero()
}
