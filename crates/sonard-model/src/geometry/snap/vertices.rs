//! Grouping of segment ends into vertices.

use std::collections::HashMap;

use rstar::{RTree, primitives::GeomWithData};
use smallvec::SmallVec;

use crate::geometry::{DVec2, union_find::UnionFind};

/// Maximum number of neighbours per position and of members per vertex: bounds the work in plans
/// with a thousand ends within a millimetre.
const MAX_NEAR: usize = 32;

/// Weight of the drawn positions of a vertex's ends relative to that of their lines. The
/// intersection of lines that differ by less than a milliradian is ill-defined.
const HOLD: f64 = 1e-6;

/// End of a segment: index of the segment, and `true` for its second end.
pub type SegmentEnd = (u32, bool);

/// Distinct end points of segments.
pub(super) struct Vertices {
    drawn: Vec<(DVec2, DVec2)>,
    /// Vertices of both ends of each segment.
    vertex_of: Vec<[u32; 2]>,
    /// Current positions of the vertices, metres.
    pub(super) at: Vec<DVec2>,
    ends: Vec<SmallVec<[SegmentEnd; 2]>>,
    /// Row of short segments of each vertex; see [`Self::are_in_a_row`].
    rows: Vec<u32>,
}

impl Vertices {
    pub(super) fn from_segments(drawn: &[(DVec2, DVec2)], tolerance_m: f64) -> Self {
        let (places, place_of) = places(drawn);
        let mut rows = UnionFind::new(places.len());
        for (&[a, b], segment) in place_of.iter().zip(drawn) {
            if segment.0.distance(segment.1) <= tolerance_m {
                rows.union(a, b);
            }
        }
        let groups = group(&places, &mut rows, tolerance_m);
        let mut vertices = Self {
            drawn: drawn.to_vec(),
            vertex_of: place_of.iter().map(|ends| ends.map(|end| groups[end as usize])).collect(),
            at: Vec::new(),
            ends: Vec::new(),
            rows: Vec::new(),
        };
        let count = groups.iter().max().map_or(0, |last| last + 1) as usize;
        vertices.ends.resize(count, SmallVec::new());
        vertices.rows.resize(count, 0);
        for (place, &vertex) in groups.iter().enumerate() {
            vertices.rows[vertex as usize] = rows.root(place as u32);
        }
        for (segment, &[a, b]) in vertices.vertex_of.iter().enumerate() {
            vertices.ends[a as usize].push((segment as u32, false));
            vertices.ends[b as usize].push((segment as u32, true));
        }
        vertices.at = (0..count).map(|vertex| vertices.common_point(vertex, tolerance_m)).collect();
        vertices
    }

    pub(super) fn len(&self) -> usize {
        self.at.len()
    }

    /// Segment with its ends as drawn.
    pub(super) fn drawn(&self, segment: usize) -> (DVec2, DVec2) {
        self.drawn[segment]
    }

    pub(super) fn drawn_end(&self, (segment, at_b): SegmentEnd) -> DVec2 {
        let (a, b) = self.drawn[segment as usize];
        if at_b { b } else { a }
    }

    pub(super) fn segments(&self) -> usize {
        self.drawn.len()
    }

    /// Segment with its current ends.
    pub(super) fn segment(&self, segment: usize) -> (DVec2, DVec2) {
        let [a, b] = self.vertex_of[segment];
        (self.at[a as usize], self.at[b as usize])
    }

    pub(super) fn vertex_of(&self, (segment, at_b): SegmentEnd) -> u32 {
        self.vertex_of[segment as usize][usize::from(at_b)]
    }

    /// Ends at a vertex.
    pub(super) fn ends(&self, vertex: u32) -> impl Iterator<Item = SegmentEnd> {
        self.ends[vertex as usize].iter().copied()
    }

    /// Vertex at the segment's opposite end.
    pub(super) fn opposite(&self, (segment, at_b): SegmentEnd) -> u32 {
        self.vertex_of((segment, !at_b))
    }

    /// Returns `true` if two vertices are connected by segments shorter than the tolerance: a
    /// finely drawn curve.
    pub(super) fn are_in_a_row(&self, a: u32, b: u32) -> bool {
        self.rows[a as usize] == self.rows[b as usize]
    }

    /// Lines of the segments at a vertex, as drawn: a point and a unit normal.
    pub(super) fn lines(&self, vertex: u32) -> impl Iterator<Item = (DVec2, DVec2)> {
        self.ends(vertex).map(|end| {
            let (a, b) = self.drawn[end.0 as usize];
            (self.drawn_end(end), (b - a).normalize_or_zero().perp())
        })
    }

    /// Position of a vertex: nearest to all its lines and, where undetermined, to the drawn ends.
    fn common_point(&self, vertex: usize, tolerance_m: f64) -> DVec2 {
        let lines: SmallVec<[_; 4]> = self.lines(vertex as u32).collect();
        let first = lines[0].0;
        if lines.iter().all(|(point, _)| *point == first) {
            return first;
        }
        let count = lines.len() as f64;
        let middle = first + lines.iter().map(|(point, _)| *point - first).sum::<DVec2>() / count;
        // Normal equations of the sum of (n . (x - p))^2 and HOLD |x - held|^2.
        let [mut xx, mut xy, mut yy] = [HOLD, 0.0, HOLD];
        for (_, normal) in &lines {
            xx += normal.x * normal.x;
            xy += normal.x * normal.y;
            yy += normal.y * normal.y;
        }
        let determinant = xx * yy - xy * xy;
        let mut at = middle;
        // Iterated with the current position held, so that the position is exact for intersecting
        // lines.
        for _ in 0..3 {
            let right: DVec2 =
                lines.iter().map(|&(point, normal)| normal.dot(point - at) * normal).sum();
            let off = DVec2::new(yy * right.x - xy * right.y, xx * right.y - xy * right.x);
            at += off / determinant;
        }
        let is_near = lines.iter().all(|(point, _)| point.distance(at) <= tolerance_m);
        if is_near { at } else { middle }
    }
}

/// Distinct end points, and their indices for each segment.
fn places(drawn: &[(DVec2, DVec2)]) -> (Vec<DVec2>, Vec<[u32; 2]>) {
    let mut index_of = HashMap::new();
    let mut places = Vec::new();
    let mut place = |at: DVec2| {
        // Maps -0.0 to 0.0.
        let key = (at + DVec2::ZERO).to_array().map(f64::to_bits);
        *index_of.entry(key).or_insert_with(|| {
            places.push(at);
            places.len() as u32 - 1
        })
    };
    let ends: Vec<_> = drawn.iter().map(|&(a, b)| [place(a), place(b)]).collect();
    (places, ends)
}

/// Vertex of each position. Nearest positions are merged first, as long as all members are within
/// the tolerance of each other and no two are in a row.
fn group(places: &[DVec2], rows: &mut UnionFind, tolerance_m: f64) -> Vec<u32> {
    let tree = RTree::bulk_load(
        places.iter().zip(0_u32..).map(|(p, i)| GeomWithData::new(p.to_array(), i)).collect(),
    );
    let mut pairs = Vec::new();
    for (place, index) in places.iter().zip(0_u32..) {
        let near = tree.nearest_neighbor_iter_with_distance_2(place.to_array());
        let near = near.take(MAX_NEAR).take_while(|(_, apart)| *apart <= tolerance_m.powi(2));
        let after = near.filter(|(other, _)| other.data > index);
        pairs.extend(after.map(|(other, apart)| (apart, index, other.data)));
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut group_of: Vec<u32> = (0..places.len() as u32).collect();
    let mut members: HashMap<u32, SmallVec<[u32; 4]>> = HashMap::new();
    for (_, a, b) in pairs {
        let [into, from] = [a, b].map(|place| group_of[place as usize]);
        if into == from {
            continue;
        }
        let members_of = |group: u32| {
            members.get(&group).cloned().unwrap_or_else(|| SmallVec::from_slice(&[group]))
        };
        let (mut kept, joining) = (members_of(into), members_of(from));
        let mut can_join = |a: u32, b: u32| {
            let apart_m = places[a as usize].distance(places[b as usize]);
            apart_m <= tolerance_m && rows.root(a) != rows.root(b)
        };
        let all_can = kept.len() + joining.len() <= MAX_NEAR
            && kept.iter().all(|&a| joining.iter().all(|&b| can_join(a, b)));
        if all_can {
            joining.iter().for_each(|&place| group_of[place as usize] = into);
            kept.extend(joining);
            members.insert(into, kept);
            members.remove(&from);
        }
    }
    numbered(&group_of)
}

/// Renumbers groups from 0 in order of first appearance.
fn numbered(group_of: &[u32]) -> Vec<u32> {
    let mut numbers = HashMap::new();
    let number = |group: &u32| {
        let next = numbers.len() as u32;
        *numbers.entry(*group).or_insert(next)
    };
    group_of.iter().map(number).collect()
}
