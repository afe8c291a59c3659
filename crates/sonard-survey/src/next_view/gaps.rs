//! Walls that may close gaps between free ends.

use sonard_model::geometry::{DVec2, distance_to_segment};

use crate::{
    arrangement::{Segment, free_ends},
    moves::crosses,
};

/// Limits of the length of a wall in a gap, metres.
const LENGTH_M: [f64; 2] = [0.05, 4.0];
/// Minimum distance of a wall in a gap from all stops, metres.
const CLEAR_M: f64 = 0.1;
/// Distance from the ends of a wall in a gap within which it may touch others, metres.
const TOUCHING_M: f64 = 0.005;
/// Depths of niches, metres.
const NICHE_M: [f64; 4] = [0.4, 0.8, 1.2, 1.6];
/// Maximum number of closures, the shortest first.
const MAX_CLOSURES: usize = 200;

/// End of a wall that meets no other.
#[derive(Debug, Clone, Copy)]
struct FreeEnd {
    at: DVec2,
    /// Direction away from its wall.
    outwards: DVec2,
    wall: usize,
}

/// Walls by which free ends may be joined, the shortest first: an end extended to the next wall; two
/// ends joined straight, by a corner of two walls that go on along their own wall or square to it,
/// or by three walls, at some depths, where both go on in one direction.
pub(super) fn closures(walls: &[Segment], stops: &[DVec2]) -> Vec<Vec<Segment>> {
    let ends = ends(walls);
    let mut found: Vec<Vec<Segment>> =
        ends.iter().filter_map(|end| extension(walls, end)).map(|wall| vec![wall]).collect();
    // Lines of new walls are none of those in use.
    let new = walls.iter().map(|wall| wall.line + 1).max().unwrap_or(0);
    for (at, a) in ends.iter().enumerate() {
        for b in ends[at + 1..].iter().filter(|b| b.wall != a.wall) {
            let chain = |points: Vec<DVec2>| {
                let walls = points.windows(2).zip(new..);
                walls.map(|(ends, line)| Segment { line, a: ends[0], b: ends[1] }).collect()
            };
            found.push(chain(vec![a.at, b.at]));
            found.extend(corners(a, b).map(|corner| chain(vec![a.at, corner, b.at])));
            found.extend(niches(a, b).map(|[c, d]| chain(vec![a.at, c, d, b.at])));
        }
    }
    found.retain(|of| of.iter().all(|wall| is_possible(wall, walls, stops)));
    let length_m = |of: &[Segment]| of.iter().map(Segment::length_m).sum::<f64>();
    found.sort_by(|a, b| length_m(a).total_cmp(&length_m(b)));
    found.truncate(MAX_CLOSURES);
    found
}

fn ends(walls: &[Segment]) -> Vec<FreeEnd> {
    let mut found = Vec::new();
    for (wall, of) in walls.iter().enumerate().filter(|(at, _)| free_ends(walls, *at) > 0) {
        let outwards = (of.b - of.a).normalize_or_zero();
        let both = [(of.a, -outwards), (of.b, outwards)];
        let free = both.into_iter().filter(|(at, _)| {
            let mut others = walls.iter().enumerate().filter(|(other, _)| *other != wall);
            !others.any(|(_, of)| distance_to_segment(*at, of.a, of.b) < TOUCHING_M)
        });
        found.extend(free.map(|(at, outwards)| FreeEnd { at, outwards, wall }));
    }
    found
}

/// Wall from a free end on to the nearest other wall.
fn extension(walls: &[Segment], end: &FreeEnd) -> Option<Segment> {
    let [_, max_m] = LENGTH_M;
    let hit_m = |wall: &Segment| {
        let across = wall.b - wall.a;
        let sine = end.outwards.perp_dot(across);
        let to = wall.a - end.at;
        let (along_m, share) = (to.perp_dot(across) / sine, to.perp_dot(end.outwards) / sine);
        (sine.abs() > 1e-6 && (0.0..=1.0).contains(&share) && along_m > 0.0).then_some(along_m)
    };
    let others = walls.iter().enumerate().filter(|(at, _)| *at != end.wall);
    let next_m = others.filter_map(|(_, wall)| hit_m(wall)).fold(f64::INFINITY, f64::min);
    let b = end.at + next_m * end.outwards;
    (next_m < max_m).then_some(Segment { line: walls[end.wall].line, a: end.at, b })
}

/// Minimum sine of the angle of a corner.
const MIN_SINE: f64 = 0.2;

/// Directions in which a wall may go on from a free end.
fn ways(end: &FreeEnd) -> [DVec2; 3] {
    [end.outwards, end.outwards.perp(), -end.outwards.perp()]
}

fn pairs_of_ways(a: &FreeEnd, b: &FreeEnd) -> impl Iterator<Item = [DVec2; 2]> {
    let of_b = ways(b);
    ways(a).into_iter().flat_map(move |along| of_b.into_iter().map(move |other| [along, other]))
}

/// Corners of two walls that go on from free ends.
fn corners(a: &FreeEnd, b: &FreeEnd) -> impl Iterator<Item = DVec2> {
    let (from, to) = (a.at, b.at - a.at);
    pairs_of_ways(a, b).filter_map(move |[along, other]| {
        let sine = along.perp_dot(other);
        let [first_m, second_m] = [to.perp_dot(other), to.perp_dot(along)].map(|of| of / sine);
        let is_ahead = first_m > LENGTH_M[0] && second_m > LENGTH_M[0];
        (sine.abs() > MIN_SINE && is_ahead).then(|| from + first_m * along)
    })
}

/// Corners of niches: of walls that go on in one direction from two free ends, and of the wall
/// across, at each depth beyond the farther end.
fn niches(a: &FreeEnd, b: &FreeEnd) -> impl Iterator<Item = [DVec2; 2]> {
    let (a_m, b_m) = (a.at, b.at);
    pairs_of_ways(a, b).flat_map(move |[along, other]| {
        let is_parallel = along.perp_dot(other).abs() <= MIN_SINE && along.dot(other) > 0.0;
        let depths = if is_parallel { &NICHE_M[..] } else { &[] };
        let far_m = along.dot(a_m).max(along.dot(b_m));
        depths.iter().map(move |depth_m| {
            let reach = |at: DVec2, way: DVec2| {
                at + way * (far_m + depth_m - along.dot(at)) / along.dot(way)
            };
            [reach(a_m, along), reach(b_m, other)]
        })
    })
}

/// Returns `true` if a wall has a length, crosses no other and leaves room around all stops.
fn is_possible(wall: &Segment, walls: &[Segment], stops: &[DVec2]) -> bool {
    let length_m = wall.length_m();
    let inner = TOUCHING_M / length_m;
    let inside = [wall.a.lerp(wall.b, inner), wall.b.lerp(wall.a, inner)];
    (LENGTH_M[0]..LENGTH_M[1]).contains(&length_m)
        && walls.iter().all(|of| !crosses(inside, [of.a, of.b]))
        && stops.iter().all(|stop| distance_to_segment(*stop, wall.a, wall.b) > CLEAR_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(line: usize, a: [f64; 2], b: [f64; 2]) -> Segment {
        Segment { line, a: a.into(), b: b.into() }
    }

    /// An L without the two walls of one arm is closed by that arm, and by shorter ways.
    #[test]
    fn open_arm_is_closed_by_its_walls() {
        let walls = [
            wall(0, [3.0, 3.0], [3.0, 0.0]),
            wall(1, [3.0, 0.0], [0.0, 0.0]),
            wall(2, [0.0, 0.0], [0.0, 1.5]),
            wall(3, [0.0, 1.5], [1.5, 1.5]),
        ];
        let found = closures(&walls, &[DVec2::new(2.0, 1.0)]);
        let has = |corner: [f64; 2]| {
            let is_there =
                |of: &Vec<Segment>| of.len() == 2 && of[0].b.distance(corner.into()) < 1e-9;
            found.iter().any(is_there)
        };
        assert!(has([1.5, 3.0]), "{found:?}");
        // Where the end of the arm is open, too, its depth is unknown.
        let open = [wall(0, [3.0, 2.0], [3.0, 0.0]), walls[1], walls[2], walls[3]];
        let deep = closures(&open, &[DVec2::new(2.0, 1.0)]);
        let is_niche = |of: &&Vec<Segment>| of.len() == 3;
        assert!(deep.iter().filter(is_niche).count() >= NICHE_M.len(), "{deep:?}");
        assert!(found.iter().any(|of| of.len() == 1 && of[0].length_m() > 2.0), "{found:?}");
        let from_ends = [DVec2::new(3.0, 3.0), DVec2::new(1.5, 1.5)];
        for of in &found {
            assert!(from_ends.iter().any(|end| of[0].a.distance(*end) < 1e-9), "{of:?}");
        }
        // The way through a stop is none.
        let found = closures(&walls, &[DVec2::new(2.25, 2.25)]);
        assert!(!found.iter().any(|of| of.len() == 1 && of[0].b == walls[0].a), "{found:?}");
    }

    #[test]
    fn closed_rooms_have_no_closures() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let walls: Vec<Segment> =
            (0..4).map(|at| wall(at, corners[at], corners[(at + 1) % 4])).collect();
        assert!(closures(&walls, &[DVec2::ONE]).is_empty());
        // A free partition may go on to the wall ahead.
        let partition = wall(4, [1.0, 0.0], [1.0, 1.2]);
        let found = closures(&[&walls[..], &[partition]].concat(), &[DVec2::new(0.5, 1.0)]);
        let [of] = &found[..] else { panic!("{found:?}") };
        assert!(of[0].b.distance(DVec2::new(1.0, 2.0)) < 1e-9 && of[0].line == 4, "{of:?}");
    }
}
