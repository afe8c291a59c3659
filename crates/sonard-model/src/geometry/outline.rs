//! What segments that meet enclose.

use smallvec::SmallVec;

use super::{Arrangement, DVec2, sets::Sets};

impl Arrangement {
    /// Once round the outside of each group of pieces that hang together: the points in order, clockwise. A
    /// piece with the outside on both of its sides is passed there and back.
    #[must_use]
    pub fn outlines(&self) -> Vec<Vec<u32>> {
        let ways = Ways::of(self);
        let mut groups = Sets::new(self.points.len());
        for piece in &self.pieces {
            groups.join(piece.ends[0], piece.ends[1]);
        }
        // Of all ways round the faces of a group that round its outside encloses the least: less than nothing.
        let mut best: Vec<Option<(f64, u32)>> = vec![None; self.points.len()];
        let mut is_seen = vec![false; 2 * self.pieces.len()];
        for start in 0..is_seen.len() as u32 {
            if is_seen[start as usize] {
                continue;
            }
            let mut area = 0.0;
            let origin = self.points[ways.from(start) as usize];
            for way in ways.round(start) {
                is_seen[way as usize] = true;
                let [a, b] =
                    [ways.from(way), ways.from(way ^ 1)].map(|p| self.points[p as usize] - origin);
                area += 0.5 * a.perp_dot(b);
            }
            let known = &mut best[groups.root(ways.from(start)) as usize];
            if known.is_none_or(|(least, _)| area < least) {
                *known = Some((area, start));
            }
        }
        let walk = |(_, start): (f64, u32)| ways.round(start).map(|way| ways.from(way)).collect();
        best.into_iter().flatten().map(walk).collect()
    }
}

/// Pieces as ways from end to end: `2 i` along piece `i`, `2 i + 1` back.
struct Ways<'a> {
    arrangement: &'a Arrangement,
    /// For each way that which goes on round the face on its left.
    next: Vec<u32>,
}

impl<'a> Ways<'a> {
    fn of(arrangement: &'a Arrangement) -> Self {
        let mut around: Vec<SmallVec<[(f64, u32); 4]>> =
            vec![SmallVec::new(); arrangement.points.len()];
        for (piece, index) in arrangement.pieces.iter().zip(0..) {
            let [a, b] = piece.ends.map(|end| arrangement.points[end as usize]);
            around[piece.ends[0] as usize].push(((b - a).to_angle(), 2 * index));
            around[piece.ends[1] as usize].push(((a - b).to_angle(), 2 * index + 1));
        }
        let mut next = vec![0; 2 * arrangement.pieces.len()];
        for ways in &mut around {
            ways.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for (at, &(_, leaving)) in ways.iter().enumerate() {
                // Who arrives against this way turns off as far to the right as there is.
                next[(leaving ^ 1) as usize] = ways[(at + ways.len() - 1) % ways.len()].1;
            }
        }
        Self { arrangement, next }
    }

    fn from(&self, way: u32) -> u32 {
        self.arrangement.pieces[way as usize / 2].ends[way as usize % 2]
    }

    fn round(&self, start: u32) -> impl Iterator<Item = u32> {
        let mut ahead = Some(start);
        std::iter::from_fn(move || {
            let way = ahead?;
            ahead = Some(self.next[way as usize]).filter(|&next| next != start);
            Some(way)
        })
    }
}

/// Whether a point lies inside a closed line through `corners` (even-odd rule; on it: either answer).
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

/// The area inside a closed line through `corners` that does not cross itself.
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
    fn a_group_has_one_outline_with_all_that_hangs_on_it() {
        let segment = |ax: f64, ay: f64, bx: f64, by: f64| (DVec2::new(ax, ay), DVec2::new(bx, by));
        let two_rooms = [
            segment(0.0, 0.0, 4.0, 0.0),
            segment(4.0, 0.0, 4.0, 2.0),
            segment(4.0, 2.0, 0.0, 2.0),
            segment(0.0, 2.0, 0.0, 0.0),
            // Between them, past the wall outside; and a table within.
            segment(2.0, 0.0, 2.0, 3.0),
            segment(0.5, 0.5, 1.0, 0.5),
        ];
        let made = Arrangement::of(&two_rooms);
        let mut outlines: Vec<Vec<DVec2>> = made
            .outlines()
            .iter()
            .map(|walk| walk.iter().map(|&point| made.points[point as usize]).collect())
            .collect();
        outlines.sort_by_key(Vec::len);
        assert_eq!(outlines.len(), 2);
        assert_eq!(outlines[0].len(), 2);
        assert!((enclosed_area(&outlines[1]) - 8.0).abs() < 1e-12);
        for (x, y, is_inside) in [(1.0, 1.0, true), (3.0, 1.0, true), (2.5, 2.5, false)] {
            assert_eq!(encloses(&outlines[1], DVec2::new(x, y)), is_inside, "({x}, {y})");
        }
    }

    /// However small a room is, and however it is divided: the outside is the face that encloses less than nothing.
    #[test]
    fn small_rooms_have_outlines_too() {
        let at = |x: f64, y: f64| DVec2::new(3.0 + 0.1 * x, -2.0 + 0.1 * y);
        let corners = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        let mut segments: Vec<_> = (0..4).map(|i| (corners[i], corners[(i + 1) % 4])).collect();
        segments.push((corners[0], corners[2]));
        let made = Arrangement::of(&segments);
        let outlines = made.outlines();
        assert_eq!(outlines.len(), 1);
        let outline: Vec<DVec2> =
            outlines[0].iter().map(|&point| made.points[point as usize]).collect();
        assert_eq!(outline.len(), 4, "{outline:?}");
        assert!((enclosed_area(&outline) - 0.01).abs() < 1e-12);
    }
}
