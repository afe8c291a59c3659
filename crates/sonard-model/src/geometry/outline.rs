//! Outer boundaries of connected segments.

use smallvec::SmallVec;

use super::{Arrangement, DVec2, union_find::UnionFind};

impl Arrangement {
    /// Outer boundary of each connected component: its points in order, clockwise. A piece with the
    /// outside on both sides is traversed in both directions.
    #[must_use]
    pub fn outlines(&self) -> Vec<Vec<u32>> {
        let half_edges = HalfEdges::new(self);
        let mut components = UnionFind::new(self.points.len());
        for piece in &self.pieces {
            components.union(piece.ends[0], piece.ends[1]);
        }
        // The outer face of a component has the smallest signed area, which is negative.
        let mut best: Vec<Option<(f64, u32)>> = vec![None; self.points.len()];
        let mut is_seen = vec![false; 2 * self.pieces.len()];
        for start in 0..is_seen.len() as u32 {
            if is_seen[start as usize] {
                continue;
            }
            let mut area = 0.0;
            let origin = self.points[half_edges.origin(start) as usize];
            for half_edge in half_edges.face(start) {
                is_seen[half_edge as usize] = true;
                let [a, b] = [half_edge, half_edge ^ 1]
                    .map(|end| self.points[half_edges.origin(end) as usize] - origin);
                area += 0.5 * a.perp_dot(b);
            }
            let smallest = &mut best[components.root(half_edges.origin(start)) as usize];
            if smallest.is_none_or(|(smallest, _)| area < smallest) {
                *smallest = Some((area, start));
            }
        }
        let walk = |(_, start): (f64, u32)| {
            half_edges.face(start).map(|half_edge| half_edges.origin(half_edge)).collect()
        };
        best.into_iter().flatten().map(walk).collect()
    }
}

/// Directed pieces: `2 i` along piece `i`, `2 i + 1` against it.
struct HalfEdges<'a> {
    arrangement: &'a Arrangement,
    /// Next half-edge of the face on the left of each half-edge.
    next: Vec<u32>,
}

impl<'a> HalfEdges<'a> {
    fn new(arrangement: &'a Arrangement) -> Self {
        let mut around: Vec<SmallVec<[(f64, u32); 4]>> =
            vec![SmallVec::new(); arrangement.points.len()];
        for (piece, index) in arrangement.pieces.iter().zip(0..) {
            let [a, b] = piece.ends.map(|end| arrangement.points[end as usize]);
            around[piece.ends[0] as usize].push(((b - a).to_angle(), 2 * index));
            around[piece.ends[1] as usize].push(((a - b).to_angle(), 2 * index + 1));
        }
        let mut next = vec![0; 2 * arrangement.pieces.len()];
        for outgoing in &mut around {
            outgoing.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for (at, &(_, leaving)) in outgoing.iter().enumerate() {
                // The face continues with the rightmost turn.
                next[(leaving ^ 1) as usize] =
                    outgoing[(at + outgoing.len() - 1) % outgoing.len()].1;
            }
        }
        Self { arrangement, next }
    }

    fn origin(&self, half_edge: u32) -> u32 {
        self.arrangement.pieces[half_edge as usize / 2].ends[half_edge as usize % 2]
    }

    fn face(&self, start: u32) -> impl Iterator<Item = u32> {
        let mut ahead = Some(start);
        std::iter::from_fn(move || {
            let half_edge = ahead?;
            ahead = Some(self.next[half_edge as usize]).filter(|&next| next != start);
            Some(half_edge)
        })
    }
}

/// Returns `true` if a point lies inside the closed polygon of `corners` (even-odd rule; undefined
/// on the boundary).
#[must_use]
pub fn encloses(corners: &[DVec2], point: DVec2) -> bool {
    let next = corners.iter().cycle().skip(1);
    let crossings = corners
        .iter()
        .zip(next)
        .filter(|(a, b)| {
            (a.y > point.y) != (b.y > point.y)
                && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
        })
        .count();
    crossings % 2 == 1
}

/// Area of the simple closed polygon of `corners`.
#[must_use]
pub fn enclosed_area(corners: &[DVec2]) -> f64 {
    let Some(&first) = corners.first() else { return 0.0 };
    let next = corners.iter().cycle().skip(1);
    let doubled: f64 =
        corners.iter().zip(next).map(|(&a, &b)| (a - first).perp_dot(b - first)).sum();
    0.5 * doubled.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn component_has_one_outline() {
        let segment = |ax: f64, ay: f64, bx: f64, by: f64| (DVec2::new(ax, ay), DVec2::new(bx, by));
        let two_rooms = [
            segment(0.0, 0.0, 4.0, 0.0),
            segment(4.0, 0.0, 4.0, 2.0),
            segment(4.0, 2.0, 0.0, 2.0),
            segment(0.0, 2.0, 0.0, 0.0),
            // A partition that extends beyond the outer wall, and a table inside.
            segment(2.0, 0.0, 2.0, 3.0),
            segment(0.5, 0.5, 1.0, 0.5),
        ];
        let arrangement = Arrangement::from_segments(&two_rooms);
        let mut outlines: Vec<Vec<DVec2>> = arrangement
            .outlines()
            .iter()
            .map(|walk| walk.iter().map(|&point| arrangement.points[point as usize]).collect())
            .collect();
        outlines.sort_by_key(Vec::len);
        assert_eq!(outlines.len(), 2);
        assert_eq!(outlines[0].len(), 2);
        assert!((enclosed_area(&outlines[1]) - 8.0).abs() < 1e-12);
        for (x, y, is_inside) in [(1.0, 1.0, true), (3.0, 1.0, true), (2.5, 2.5, false)] {
            assert_eq!(encloses(&outlines[1], DVec2::new(x, y)), is_inside, "({x}, {y})");
        }
    }

    /// Independent of the size and the subdivision of a room, the outer face has a negative area.
    #[test]
    fn small_rooms_have_outlines() {
        let at = |x: f64, y: f64| DVec2::new(3.0 + 0.1 * x, -2.0 + 0.1 * y);
        let corners = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        let mut segments: Vec<_> = (0..4).map(|i| (corners[i], corners[(i + 1) % 4])).collect();
        segments.push((corners[0], corners[2]));
        let arrangement = Arrangement::from_segments(&segments);
        let outlines = arrangement.outlines();
        assert_eq!(outlines.len(), 1);
        let outline: Vec<DVec2> =
            outlines[0].iter().map(|&point| arrangement.points[point as usize]).collect();
        assert_eq!(outline.len(), 4, "{outline:?}");
        assert!((enclosed_area(&outline) - 0.01).abs() < 1e-12);
    }
}
