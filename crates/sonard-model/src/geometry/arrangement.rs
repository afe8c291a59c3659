//! Planar arrangement: segments split at their intersections, so that they touch only at their
//! ends.

use std::collections::{HashMap, HashSet};

use rstar::{
    AABB, RTree,
    primitives::{GeomWithData, Rectangle},
};

use super::DVec2;

/// Points closer than this coincide, metres: rounding of coordinates and intersections. Larger gaps
/// are closed before by [`snap`](super::snap()).
const SAME_M: f64 = 1e-9;

/// Placeholder for the ends of a segment without pieces.
const NO_ENDS: [u32; 2] = [u32::MAX; 2];

/// Maximum number of splitting rounds. Splitting and merging can create contacts by rounding, which
/// converges in one or two rounds; dozens of walls within a few millimetres need some more.
const MAX_ROUNDS: usize = 50;

/// Segments that touch only at their ends.
#[derive(Debug, Clone, Default)]
pub struct Arrangement {
    /// End points of the pieces, without duplicates.
    pub points: Vec<DVec2>,
    /// Pieces of the segments; no two connect the same points.
    pub pieces: Vec<SegmentPiece>,
    /// Overlapping segments that were given later, by the key ([`edge_key`]) of the piece that
    /// covers them.
    pub covered: HashMap<[u32; 2], Vec<u32>>,
    /// End points of each segment.
    pub ends: Vec<[u32; 2]>,
}

/// Part of a segment between two points of an [`Arrangement`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SegmentPiece {
    /// Indices of the end points, in the segment's direction.
    pub ends: [u32; 2],
    /// Index of the segment.
    pub segment: u32,
}

/// Key of a piece, independent of its direction: the indices of its ends in ascending order.
#[must_use]
pub fn edge_key([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

impl Arrangement {
    /// Splits segments at crossings and contacts. Of overlapping segments the first one is kept.
    /// The run time is O(n log n) for segments with few neighbours.
    #[must_use]
    pub fn from_segments(segments: &[(DVec2, DVec2)]) -> Self {
        let mut parts: Vec<SegmentPart> = segments
            .iter()
            .zip(0..)
            .map(|(&(a, b), segment)| SegmentPart { a, b, segment })
            .collect();
        let mut joined = join(&mut parts);
        // After each round, ends are identical or farther apart than SAME_M, and every contact is
        // split.
        for _ in 0..MAX_ROUNDS {
            let cuts = cuts(&parts);
            if cuts.iter().all(Vec::is_empty) {
                break;
            }
            parts = parts.iter().zip(cuts).flat_map(|(part, cuts)| part.cut(cuts)).collect();
            joined = join(&mut parts);
        }
        collect(&parts, joined, segments.len())
    }
}

#[derive(Debug, Clone, Copy)]
struct SegmentPart {
    a: DVec2,
    b: DVec2,
    segment: u32,
}

impl SegmentPart {
    /// Pieces of this part, split at `points` near it.
    fn cut(self, mut points: Vec<DVec2>) -> Vec<Self> {
        if points.is_empty() {
            return vec![self];
        }
        let along = self.b - self.a;
        points.sort_by(|p, q| (*p - self.a).dot(along).total_cmp(&(*q - self.a).dot(along)));
        points.push(self.b);
        let mut pieces = Vec::with_capacity(points.len());
        let mut from = self.a;
        for to in points {
            if from.distance(to) > SAME_M {
                pieces.push(Self { a: from, b: to, ..self });
                from = to;
            }
        }
        pieces
    }

    fn bounds(&self) -> AABB<[f64; 2]> {
        let (low, high) = (self.a.min(self.b) - SAME_M, self.a.max(self.b) + SAME_M);
        AABB::from_corners(low.to_array(), high.to_array())
    }

    /// Returns `true` if `point` lies on this part but at neither end.
    fn contains_inside(&self, point: DVec2) -> bool {
        let along = self.b - self.a;
        let length = along.length();
        let place = (point - self.a).dot(along) / length;
        let height = along.perp_dot(point - self.a) / length;
        height.abs() < SAME_M
            && (0.0..length).contains(&place)
            && point.distance(self.a) > SAME_M
            && point.distance(self.b) > SAME_M
    }

    /// Intersection of two parts without a common end.
    fn crossing(&self, other: &Self) -> Option<DVec2> {
        // Exact orientation tests: a crossing within rounding of an end is resolved consistently.
        if !self.separates_ends_of(other) || !other.separates_ends_of(self) {
            return None;
        }
        let (u, v) = (self.b - self.a, other.b - other.a);
        let point = self.a + (other.a - self.a).perp_dot(v) / u.perp_dot(v) * u;
        let ends = [self.a, self.b, other.a, other.b];
        let near = ends.into_iter().find(|end| end.distance(point) <= SAME_M);
        Some(near.unwrap_or(point)).filter(|point| point.is_finite())
    }

    /// Returns `true` if the ends of `other` lie on opposite sides of this part's line.
    fn separates_ends_of(&self, other: &Self) -> bool {
        let [a, b, c, d] =
            [self.a, self.b, other.a, other.b].map(|p| robust::Coord { x: p.x, y: p.y });
        let sides = [c, d].map(|end| robust::orient2d(a, b, end));
        sides[0] < 0.0 && sides[1] > 0.0 || sides[1] < 0.0 && sides[0] > 0.0
    }
}

/// Split points inside each part, where another part ends or crosses it.
fn cuts(parts: &[SegmentPart]) -> Vec<Vec<DVec2>> {
    let boxes = parts.iter().enumerate().map(|(index, part)| {
        let bounds = part.bounds();
        GeomWithData::new(Rectangle::from_corners(bounds.lower(), bounds.upper()), index)
    });
    let tree = RTree::bulk_load(boxes.collect());
    let mut cuts = vec![Vec::new(); parts.len()];
    for (i, part) in parts.iter().enumerate() {
        for near in tree.locate_in_envelope_intersecting(part.bounds()) {
            let other = &parts[near.data];
            let before = cuts[i].len();
            cuts[i].extend([other.a, other.b].into_iter().filter(|&end| part.contains_inside(end)));
            let has_contact = cuts[i].len() > before
                || other.contains_inside(part.a)
                || other.contains_inside(part.b);
            if near.data > i
                && !has_contact
                && let Some(point) = part.crossing(other)
            {
                for (index, part) in [(i, part), (near.data, other)] {
                    if point != part.a && point != part.b {
                        cuts[index].push(point);
                    }
                }
            }
        }
    }
    cuts
}

/// End points of parts, and their indices for each part.
struct Joined {
    points: Vec<DVec2>,
    ends: Vec<[u32; 2]>,
}

/// Merges ends that are closer than [`SAME_M`] into the first of them.
fn join(parts: &mut [SegmentPart]) -> Joined {
    let ends: Vec<DVec2> = parts.iter().flat_map(|part| [part.a, part.b]).collect();
    let tree = RTree::bulk_load(
        ends.iter().enumerate().map(|(i, end)| GeomWithData::new(end.to_array(), i)).collect(),
    );
    let mut points = Vec::new();
    let mut point_of = vec![u32::MAX; ends.len()];
    for (i, &end) in ends.iter().enumerate() {
        if point_of[i] != u32::MAX {
            continue;
        }
        let point = points.len() as u32;
        points.push(end);
        for same in tree.locate_within_distance(end.to_array(), SAME_M * SAME_M) {
            if point_of[same.data] == u32::MAX {
                point_of[same.data] = point;
            }
        }
    }
    let ends: Vec<[u32; 2]> = point_of.chunks(2).map(|ends| [ends[0], ends[1]]).collect();
    for (part, ends) in parts.iter_mut().zip(&ends) {
        [part.a, part.b] = ends.map(|end| points[end as usize]);
    }
    Joined { points, ends }
}

/// Collects the pieces of the segments; overlapping pieces are listed as covered.
fn collect(parts: &[SegmentPart], joined: Joined, segments: usize) -> Arrangement {
    let mut result = Arrangement {
        points: joined.points,
        ends: vec![NO_ENDS; segments],
        ..Arrangement::default()
    };
    let mut seen = HashSet::new();
    for (part, ends) in parts.iter().zip(joined.ends) {
        let [first, last] = &mut result.ends[part.segment as usize];
        *first = if *first == u32::MAX { ends[0] } else { *first };
        *last = ends[1];
        if ends[0] == ends[1] {
            continue;
        }
        if seen.insert(edge_key(ends)) {
            result.pieces.push(SegmentPiece { ends, segment: part.segment });
        } else {
            result.covered.entry(edge_key(ends)).or_default().push(part.segment);
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(ax: f64, ay: f64, bx: f64, by: f64) -> (DVec2, DVec2) {
        (DVec2::new(ax, ay), DVec2::new(bx, by))
    }

    #[test]
    fn contacts_split_segments() {
        let line = segment(0.0, 0.0, 2.0, 0.0);
        let cases = [
            ("apart", vec![line, segment(0.0, 1.0, 2.0, 1.0)], 4, 2),
            ("cross", vec![line, segment(1.0, -1.0, 1.0, 1.0)], 5, 4),
            ("end on the middle", vec![line, segment(1.0, 0.0, 1.0, 1.0)], 4, 3),
            ("end on the middle, nearly", vec![line, segment(1.0, 3e-11, 1.0, 1.0)], 4, 3),
            ("common end", vec![line, segment(2.0, 0.0, 2.0, 1.0)], 3, 2),
            ("common end, nearly", vec![line, segment(2.0, 3e-11, 2.0, 1.0)], 3, 2),
            ("overlap", vec![line, segment(1.0, 0.0, 3.0, 0.0)], 4, 3),
            ("twice", vec![line, segment(2.0, 0.0, 0.0, 0.0)], 2, 1),
            ("gap above the tolerance", vec![line, segment(1.0, 1e-4, 1.0, 1.0)], 4, 2),
        ];
        for (name, segments, points, pieces) in cases {
            let arrangement = Arrangement::from_segments(&segments);
            let counts = (arrangement.points.len(), arrangement.pieces.len());
            assert_eq!(counts, (points, pieces), "{name}");
            for (ends, (a, b)) in arrangement.ends.iter().zip(&segments) {
                let [p, q] = ends.map(|end| arrangement.points[end as usize]);
                assert!(p.distance(*a) < 1e-9 && q.distance(*b) < 1e-9, "{name}");
            }
        }
    }

    #[test]
    fn pieces_preserve_length() {
        let grid: Vec<_> = (0..5)
            .flat_map(|i| {
                let x = f64::from(i) + 0.1;
                [segment(x, -0.3, x + 0.2, 5.0), segment(-0.2, x, 5.3, x - 0.1)]
            })
            .collect();
        let arrangement = Arrangement::from_segments(&grid);
        for (index, &(a, b)) in grid.iter().enumerate() {
            let length: f64 = arrangement
                .pieces
                .iter()
                .filter(|piece| piece.segment == index as u32)
                .map(|piece| {
                    let [p, q] = piece.ends.map(|end| arrangement.points[end as usize]);
                    assert!((q - p).dot(b - a) > 0.0);
                    p.distance(q)
                })
                .sum();
            assert!((length - a.distance(b)).abs() < 1e-9);
        }
        assert_eq!(arrangement.points.len(), 2 * 10 + 25);
    }
}
