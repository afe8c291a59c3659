//! Vertices that belong on a segment: T-joints, crossings with an overshoot, overlapping walls.

use rstar::{AABB, RTree, primitives::GeomWithData};
use smallvec::SmallVec;

use super::vertices::Vertices;
use crate::geometry::DVec2;

/// Maximum number of rounds. Closing one joint moves other ends, by a decreasing amount.
const MAX_ROUNDS: usize = 200;

/// Tolerance of a closed joint, metres: rounding error.
const CLOSED_M: f64 = 1e-12;

/// Weight of a vertex's foot on the segment relative to that of its own line.
const HOLD: f64 = 1e-6;

/// Nearest segments on which each vertex belongs, two at most.
pub(super) struct Joints(Vec<SmallVec<[u32; 2]>>);

impl Joints {
    pub(super) fn segments_at(&self, vertex: u32) -> &[u32] {
        &self.0[vertex as usize]
    }
}

/// Finds vertices closer than the tolerance to the inside of a segment.
pub(super) fn find(vertices: &Vertices, tolerance_m: f64) -> Joints {
    let tree = RTree::bulk_load(
        (0..vertices.len())
            .map(|v| GeomWithData::new(vertices.at[v].to_array(), v as u32))
            .collect(),
    );
    let mut found: Vec<SmallVec<[(f64, u32); 2]>> = vec![SmallVec::new(); vertices.len()];
    for segment in 0..vertices.segments() {
        let (a, b) = vertices.segment(segment);
        let ends = [false, true].map(|at_b| vertices.vertex_of((segment as u32, at_b)));
        let around = AABB::from_corners(
            (a.min(b) - tolerance_m).to_array(),
            (a.max(b) + tolerance_m).to_array(),
        );
        for near in tree.locate_in_envelope(around) {
            let vertex = near.data;
            let Some(off_m) = off_inside(vertices.at[vertex as usize], a, b) else { continue };
            let is_own =
                ends.iter().any(|&end| end == vertex || vertices.are_in_a_row(end, vertex));
            if off_m <= tolerance_m && !is_own {
                found[vertex as usize].push((off_m, segment as u32));
            }
        }
    }
    Joints(
        found
            .into_iter()
            .enumerate()
            .map(|(vertex, near)| choose(vertices, vertex, near, tolerance_m))
            .collect(),
    )
}

/// Distance of a point from a segment, metres; `None` if the nearest point is an end.
fn off_inside(point: DVec2, a: DVec2, b: DVec2) -> Option<f64> {
    let along = (b - a).normalize_or_zero();
    let place_m = (point - a).dot(along);
    (place_m > 0.0 && place_m < a.distance(b)).then(|| along.perp_dot(point - a).abs())
}

/// Selects the nearest segment, and a second one whose intersection with it is within the
/// tolerance.
fn choose(
    vertices: &Vertices,
    vertex: usize,
    mut near: SmallVec<[(f64, u32); 2]>,
    tolerance_m: f64,
) -> SmallVec<[u32; 2]> {
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut near = near.into_iter().map(|(_, segment)| segment);
    let mut chosen: SmallVec<[u32; 2]> = near.next().into_iter().collect();
    if let Some(&first) = chosen.first() {
        let at = vertices.at[vertex];
        let joins = |other: &u32| {
            intersection(vertices.segment(first as usize), vertices.segment(*other as usize))
                .is_some_and(|point| point.distance(at) <= tolerance_m)
        };
        chosen.extend(near.find(joins));
    }
    chosen
}

fn intersection((a, b): (DVec2, DVec2), (c, d): (DVec2, DVec2)) -> Option<DVec2> {
    let (u, v) = (b - a, d - c);
    let slant = u.perp_dot(v);
    let is_parallel = slant.abs() <= 1e-9 * u.length() * v.length();
    (!is_parallel).then(|| a + (c - a).perp_dot(v) / slant * u)
}

/// Moves vertices onto their segments until all joints are closed. A segment that moves takes its
/// vertices along.
pub(super) fn close(vertices: &mut Vertices, joints: &Joints, tolerance_m: f64) {
    let on: Vec<u32> = (0..vertices.len() as u32)
        .filter(|&vertex| !joints.segments_at(vertex).is_empty())
        .collect();
    let from = vertices.at.clone();
    for _ in 0..MAX_ROUNDS {
        let mut is_converged = true;
        for &vertex in &on {
            let at = vertices.at[vertex as usize];
            let position = place(
                vertices,
                vertex,
                joints.segments_at(vertex),
                from[vertex as usize],
                tolerance_m,
            );
            if position.distance(at) > CLOSED_M * 1e-2 {
                vertices.at[vertex as usize] = position;
                is_converged &= position.distance(at) <= CLOSED_M;
            }
        }
        if is_converged {
            break;
        }
    }
}

/// Position on the joint for a vertex at `from`.
fn place(vertices: &Vertices, vertex: u32, on: &[u32], from: DVec2, tolerance_m: f64) -> DVec2 {
    let segments = on.iter().map(|&segment| vertices.segment(segment as usize));
    let lines: SmallVec<[_; 2]> = segments.collect();
    if let [a, b] = lines[..]
        && let Some(point) = intersection(a, b)
        && point.distance(from) <= 2.0 * tolerance_m
    {
        return point;
    }
    let (a, b) = lines[0];
    let along = (b - a).normalize_or_zero();
    let foot = a + (from - a).dot(along) * along;
    // Minimizes (n . (slid - p))^2, summed over the vertex's own lines, plus HOLD times the squared
    // distance to the current position.
    let hold =
        HOLD + vertices.lines(vertex).map(|(_, normal)| normal.dot(along).powi(2)).sum::<f64>();
    let mut slid = foot;
    for _ in 0..3 {
        let pulls = vertices
            .lines(vertex)
            .map(|(point, normal)| normal.dot(point - slid) * normal.dot(along));
        slid += pulls.sum::<f64>() / hold * along;
    }
    if slid.distance(from) <= tolerance_m {
        slid
    } else if foot.distance(from) <= 2.0 * tolerance_m {
        foot
    } else {
        // The segment was moved away: the vertex stays and the joint is open.
        from
    }
}
