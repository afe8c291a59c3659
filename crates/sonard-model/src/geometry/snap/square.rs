//! Corners that were meant to be right.

use smallvec::SmallVec;

use super::{
    joints::Joints,
    vertices::{End, Vertices},
};
use crate::geometry::DVec2;

/// Corners are moved by this much at most, metres: what rounding to tenths of a millimetre does.
const MOST_M: f64 = 1e-4;

/// Moves below this are rounding of the arithmetic, metres.
const LEAST_M: f64 = 1e-13;

/// Segments go straight on where the bend is off the line by less than this, metres: rounding.
const STRAIGHT_M: f64 = 1e-9;

/// Moving one corner turns the next one's sides; each round halves what is off in a rectangle, and takes a
/// 2 pi^2 / n^2 off it in a ring of n corners.
const ROUNDS: usize = 500;

/// How much of the way each corner goes in a round. All go at once, so that their order does not matter; with
/// the whole way a parallelogram would swing to and fro for ever.
const SHARE: f64 = 0.5;

/// Segments that a side is followed along, at most.
const LONGEST: usize = 1000;

/// A corner of two sides, each as far as it goes straight on.
struct Corner {
    vertex: u32,
    /// Where its sides begin.
    far: [u32; 2],
}

/// A vertex within a side, at a share of it.
struct Within {
    vertex: u32,
    ends: [u32; 2],
    share: f64,
}

/// Makes corners of two sides right-angled where moving them by 0.1 mm or less does it. A side goes as far as
/// segments go straight on, so that it does not matter into how many a wall is split.
///
/// A corner turned in a plan and written down to a tenth of a millimetre is 90.003 degrees, say.
/// Sound cannot tell, but a mirror image can: above 90 degrees no ray comes back by both walls,
/// below it two do.
pub(super) fn square_up(vertices: &mut Vertices, joints: &Joints, most_m: f64) {
    let most_m = most_m.min(MOST_M);
    let (corners, within) = sides(vertices, joints);
    let mut is_moved = false;
    for _ in 0..ROUNDS {
        let off = |corner: &Corner| {
            let at = vertices.at[corner.vertex as usize];
            let [a, b] = corner.far.map(|far| vertices.at[far as usize]);
            let off = right_angled(at, a, b) - at;
            (LEAST_M..=most_m).contains(&off.length()).then_some((corner.vertex, off))
        };
        let moves: Vec<(u32, DVec2)> = corners.iter().filter_map(off).collect();
        if moves.is_empty() {
            break;
        }
        is_moved = true;
        for (vertex, off) in moves {
            vertices.at[vertex as usize] += SHARE * off;
        }
    }
    for Within { vertex, ends, share } in within.iter().filter(|_| is_moved) {
        let [a, b] = ends.map(|end| vertices.at[end as usize]);
        vertices.at[*vertex as usize] = a.lerp(b, *share);
    }
}

/// The corners of two sides, and the vertices within sides.
fn sides(vertices: &Vertices, joints: &Joints) -> (Vec<Corner>, Vec<Within>) {
    let (mut corners, mut within) = (Vec::new(), Vec::new());
    for vertex in 0..vertices.len() as u32 {
        let ends: SmallVec<[End; 4]> = vertices.ends(vertex).collect();
        let is_through = ends.iter().any(|&end| straight_on(vertices, end).is_some());
        match ends[..] {
            [one, other] if !is_through && joints.of(vertex).is_empty() && one.0 != other.0 => {
                corners
                    .push(Corner { vertex, far: [one, other].map(|end| far_end(vertices, end)) });
            }
            _ => {
                let through = ends.iter().find_map(|&end| Some((end, straight_on(vertices, end)?)));
                within.extend(through.map(|(end, next)| {
                    let ends = [end, next].map(|end| far_end(vertices, end));
                    let [at, a, b] = [vertex, ends[0], ends[1]].map(|v| vertices.at[v as usize]);
                    Within { vertex, ends, share: a.distance(at) / a.distance(b) }
                }));
            }
        }
    }
    (corners, within)
}

/// The vertex where the side ends that begins with this end of a segment.
fn far_end(vertices: &Vertices, start: End) -> u32 {
    let mut end = start;
    for _ in 0..LONGEST {
        let Some(next) = straight_on(vertices, (end.0, !end.1)) else { break };
        end = next;
    }
    vertices.beyond(end)
}

/// The end of the segment that goes straight on where this one ends.
fn straight_on(vertices: &Vertices, end: End) -> Option<End> {
    let vertex = vertices.vertex_of(end);
    let (at, from) = (vertices.at[vertex as usize], vertices.at[vertices.beyond(end) as usize]);
    let is_straight = |next: &End| {
        let to = vertices.at[vertices.beyond(*next) as usize];
        let (before, after) = (at - from, to - at);
        let off_m = before.perp_dot(after).abs() / (to - from).length();
        before.dot(after) > 0.0 && off_m < STRAIGHT_M
    };
    vertices.ends(vertex).filter(|next| *next != end).find(is_straight)
}

/// The point nearest to `corner` that sees `a` and `b` at a right angle: on Thales' circle.
fn right_angled(corner: DVec2, a: DVec2, b: DVec2) -> DVec2 {
    let (middle, radius) = (0.5 * (a + b), 0.5 * a.distance(b));
    middle + radius * (corner - middle).normalize_or_zero()
}
