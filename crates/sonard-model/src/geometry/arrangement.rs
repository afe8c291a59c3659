//! Segments cut where they meet, so that they touch at their ends only.

use std::collections::{HashMap, HashSet};

use rstar::{
    AABB, RTree,
    primitives::{GeomWithData, Rectangle},
};

use super::DVec2;

/// Points closer than this are one point, metres: what the rounding of coordinates and crossings leaves.
/// What was drawn apart is brought together before ([`snap`](super::snap())).
const SAME_M: f64 = 1e-9;

/// The ends of a segment of which nothing is left.
const NOWHERE: [u32; 2] = [u32::MAX; 2];

/// Cutting and joining can bring pieces into contact by rounding, which settles in a round or two; dozens of
/// walls scribbled on a few millimetres need some more.
const ROUNDS: usize = 50;

/// Segments that touch at their ends only.
#[derive(Debug, Clone, Default)]
pub struct Arrangement {
    /// Ends of pieces, each once.
    pub points: Vec<DVec2>,
    /// What is left of the segments; no two between the same points.
    pub pieces: Vec<Piece>,
    /// Segments that lie on one of these and were given later, by [`between`] its ends.
    pub covered: HashMap<[u32; 2], Vec<u32>>,
    /// For each segment the points where it ends.
    pub ends: Vec<[u32; 2]>,
}

/// A part of a segment between two points of an [`Arrangement`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece {
    /// Indices of its ends, in the segment's direction.
    pub ends: [u32; 2],
    /// Index of the segment.
    pub segment: u32,
}

/// A piece's name, whichever its direction: the indices of its ends, the smaller one first.
#[must_use]
pub fn between([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

impl Arrangement {
    /// Cuts segments where they cross or touch. Where two lie on each other, the one given first
    /// stays. Time grows like n log n for segments that meet few others.
    #[must_use]
    pub fn of(segments: &[(DVec2, DVec2)]) -> Self {
        let mut parts: Vec<Part> =
            segments.iter().zip(0..).map(|(&(a, b), segment)| Part { a, b, segment }).collect();
        let mut joined = join(&mut parts);
        // In each round ends are the same or farther apart than SAME_M, and what crosses or touches is cut there.
        for _ in 0..ROUNDS {
            let cuts = cuts(&parts);
            if cuts.iter().all(Vec::is_empty) {
                break;
            }
            parts = parts.iter().zip(cuts).flat_map(|(part, cuts)| part.cut(cuts)).collect();
            joined = join(&mut parts);
        }
        listed(&parts, joined, segments.len())
    }
}

#[derive(Debug, Clone, Copy)]
struct Part {
    a: DVec2,
    b: DVec2,
    segment: u32,
}

impl Part {
    /// This part in pieces, cut at `points` near it.
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

    /// Whether `point` lies on this part but at neither end.
    fn has_inside(&self, point: DVec2) -> bool {
        let along = self.b - self.a;
        let length = along.length();
        let place = (point - self.a).dot(along) / length;
        let height = along.perp_dot(point - self.a) / length;
        height.abs() < SAME_M
            && (0.0..length).contains(&place)
            && point.distance(self.a) > SAME_M
            && point.distance(self.b) > SAME_M
    }

    /// Where two parts that have no end in common cross.
    fn crossing(&self, other: &Self) -> Option<DVec2> {
        // The exact signs: a crossing within rounding of an end is none or a cut, as its neighbours say.
        if !self.parts_ends_of(other) || !other.parts_ends_of(self) {
            return None;
        }
        let (u, v) = (self.b - self.a, other.b - other.a);
        let point = self.a + (other.a - self.a).perp_dot(v) / u.perp_dot(v) * u;
        let ends = [self.a, self.b, other.a, other.b];
        let near = ends.into_iter().find(|end| end.distance(point) <= SAME_M);
        Some(near.unwrap_or(point)).filter(|point| point.is_finite())
    }

    /// Whether the ends of `other` lie to both sides of this part's line.
    fn parts_ends_of(&self, other: &Self) -> bool {
        let [a, b, c, d] =
            [self.a, self.b, other.a, other.b].map(|p| robust::Coord { x: p.x, y: p.y });
        let sides = [c, d].map(|end| robust::orient2d(a, b, end));
        sides[0] < 0.0 && sides[1] > 0.0 || sides[1] < 0.0 && sides[0] > 0.0
    }
}

/// For each part, the points inside it where another part ends or crosses it.
fn cuts(parts: &[Part]) -> Vec<Vec<DVec2>> {
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
            cuts[i].extend([other.a, other.b].into_iter().filter(|&end| part.has_inside(end)));
            let ends_meet =
                cuts[i].len() > before || other.has_inside(part.a) || other.has_inside(part.b);
            if near.data > i
                && !ends_meet
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

/// Points where parts end, and for each part the indices of its own.
struct Joined {
    points: Vec<DVec2>,
    ends: Vec<[u32; 2]>,
}

/// Makes ends that are closer than [`SAME_M`] one point: the first of them.
fn join(parts: &mut [Part]) -> Joined {
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

/// What is left of the segments; pieces that lie on others are put aside.
fn listed(parts: &[Part], joined: Joined, segments: usize) -> Arrangement {
    let mut result = Arrangement {
        points: joined.points,
        ends: vec![NOWHERE; segments],
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
        if seen.insert(between(ends)) {
            result.pieces.push(Piece { ends, segment: part.segment });
        } else {
            result.covered.entry(between(ends)).or_default().push(part.segment);
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
    fn meetings_cut_segments() {
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
            ("a gap that counts", vec![line, segment(1.0, 1e-4, 1.0, 1.0)], 4, 2),
        ];
        for (name, segments, points, pieces) in cases {
            let made = Arrangement::of(&segments);
            assert_eq!((made.points.len(), made.pieces.len()), (points, pieces), "{name}");
            for (ends, (a, b)) in made.ends.iter().zip(&segments) {
                let [p, q] = ends.map(|end| made.points[end as usize]);
                assert!(p.distance(*a) < 1e-9 && q.distance(*b) < 1e-9, "{name}");
            }
        }
    }

    #[test]
    fn pieces_keep_the_length_and_the_segment() {
        let grid: Vec<_> = (0..5)
            .flat_map(|i| {
                let x = f64::from(i) + 0.1;
                [segment(x, -0.3, x + 0.2, 5.0), segment(-0.2, x, 5.3, x - 0.1)]
            })
            .collect();
        let made = Arrangement::of(&grid);
        for (index, &(a, b)) in grid.iter().enumerate() {
            let length: f64 = made
                .pieces
                .iter()
                .filter(|piece| piece.segment == index as u32)
                .map(|piece| {
                    let [p, q] = piece.ends.map(|end| made.points[end as usize]);
                    assert!((q - p).dot(b - a) > 0.0);
                    p.distance(q)
                })
                .sum();
            assert!((length - a.distance(b)).abs() < 1e-9);
        }
        assert_eq!(made.points.len(), 2 * 10 + 25);
    }
}
