//! Corners of a chain of cell sides, with walls along rows and columns kept in place.
//!
//! A slanting wall appears as stairs: runs of sides that alternate between two directions. The end
//! of a thin wall, a notch or a jog does not. So only stairs of several steps are straightened.

use sonard_model::geometry::DVec2;

use super::trace::Node;

/// Minimum number of runs in stairs; fewer are a jog between two walls.
const MIN_RUNS: usize = 6;
/// Minimum length of a run that is a wall of its own, cells.
const LONG_CELLS: i64 = 10;
/// Minimum length of such a run relative to its neighbours of the same direction.
const LONGER: i64 = 3;

/// Straight row of sides, from one corner to the next.
#[derive(Debug, Clone, Copy)]
struct StraightRun {
    from: Node,
    to: Node,
}

impl StraightRun {
    fn direction(self) -> Node {
        ((self.to.0 - self.from.0).signum(), (self.to.1 - self.from.1).signum())
    }

    fn cells(self) -> i64 {
        (self.to.0 - self.from.0).abs() + (self.to.1 - self.from.1).abs()
    }
}

/// Corners of a chain; `straighten` returns the line for the nodes of stairs, ends included.
pub(super) fn corners(
    nodes: &[Node],
    is_closed: bool,
    straighten: impl Fn(&[Node]) -> Vec<DVec2>,
) -> Vec<DVec2> {
    let runs = runs(nodes, is_closed);
    let mut corners: Vec<DVec2> = Vec::new();
    let mut add = |points: Vec<DVec2>| {
        let is_known = corners.last() == points.first();
        corners.extend(points.into_iter().skip(usize::from(is_known)));
    };
    let pieces = split_at_ends(&runs, is_closed);
    for stairs in pieces.into_iter().flat_map(flights) {
        for part in split_at_walls(stairs) {
            let mut nodes: Vec<Node> = part.iter().map(|run| run.from).collect();
            nodes.extend(part.last().map(|run| run.to));
            let line = if part.len() >= MIN_RUNS {
                straighten(&nodes)
            } else {
                nodes.iter().flat_map(|node| straighten(&[*node])).collect()
            };
            add(line);
        }
    }
    if is_closed && corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    corners
}

/// Straight runs of a chain. A ring starts at its lowest, then leftmost corner, so no run is cut.
fn runs(nodes: &[Node], is_closed: bool) -> Vec<StraightRun> {
    let mut nodes = nodes.to_vec();
    if is_closed {
        let lowest = (0..nodes.len()).min_by_key(|at| (nodes[*at].1, nodes[*at].0)).unwrap_or(0);
        nodes.rotate_left(lowest);
        nodes.extend(nodes.first().copied());
    }
    let mut runs: Vec<StraightRun> = Vec::new();
    for ends in nodes.windows(2) {
        let side = StraightRun { from: ends[0], to: ends[1] };
        match runs.last_mut() {
            Some(run) if run.direction() == side.direction() => run.to = side.to,
            _ => runs.push(side),
        }
    }
    runs
}

/// Splits a chain at the ends of slanting walls, which are parts of their own: runs between stairs
/// that turn back. Otherwise one face of a thin wall would include its end, and tilt.
fn split_at_ends(runs: &[StraightRun], is_closed: bool) -> Vec<&[StraightRun]> {
    let count = runs.len();
    let direction = |at: usize, ahead: bool, by: usize| {
        let other = if ahead { at + by } else { (at + count).checked_sub(by)? };
        let is_within = is_closed || (if ahead { other < count } else { other >= count });
        (is_within && by < count).then(|| runs[other % count].direction())
    };
    let is_end = |at: &usize| {
        (1..=2).all(|by| match (direction(*at, false, by), direction(*at, true, by)) {
            (Some(before), Some(after)) => before == (-after.0, -after.1),
            _ => false,
        })
    };
    // Next to an end, the first run of a face may fit as well; the shorter run of the two is the
    // end.
    let is_shortest = |at: &usize| {
        let before = (is_closed || *at > 0).then(|| (at + count - 1) % count);
        let after = (is_closed || at + 1 < count).then(|| (at + 1) % count);
        let is_shorter = |near: usize, or_equal: bool| {
            let (own, other) = (runs[*at].cells(), runs[near].cells());
            !is_end(&near) || own < other || (or_equal && own == other)
        };
        before.is_none_or(|near| is_shorter(near, false))
            && after.is_none_or(|near| is_shorter(near, true))
    };
    let mut pieces = Vec::new();
    let mut begin = 0;
    for at in (0..count).filter(|at| is_end(at) && is_shortest(at)) {
        pieces
            .extend([&runs[begin..at], &runs[at..=at]].into_iter().filter(|part| !part.is_empty()));
        begin = at + 1;
    }
    pieces.extend(Some(&runs[begin..]).filter(|part| !part.is_empty()));
    pieces
}

/// Groups consecutive runs into flights, each with runs in at most two directions that are not
/// opposite.
fn flights(runs: &[StraightRun]) -> Vec<&[StraightRun]> {
    let mut flights = Vec::new();
    let mut begin = 0;
    for at in 0..runs.len() {
        let (x, y) = runs[at].direction();
        if runs[begin..at].iter().any(|run| run.direction() == (-x, -y)) {
            flights.push(&runs[begin..at]);
            begin = at;
        }
    }
    if begin < runs.len() {
        flights.push(&runs[begin..]);
    }
    flights
}

/// Splits stairs at runs that are walls of their own; these are parts, too.
fn split_at_walls(stairs: &[StraightRun]) -> Vec<&[StraightRun]> {
    let is_wall = |at: usize| {
        let own = stairs[at].cells();
        let neighbours = [at.checked_sub(2), Some(at + 2)];
        let neighbours = neighbours.into_iter().flatten().filter_map(|near| stairs.get(near));
        let longest = neighbours.map(|run| run.cells()).max().unwrap_or(0);
        own >= LONG_CELLS && own >= LONGER * longest
    };
    let mut parts = Vec::new();
    let mut begin = 0;
    for at in (0..stairs.len()).filter(|at| is_wall(*at)) {
        parts.extend(
            [&stairs[begin..at], &stairs[at..=at]].into_iter().filter(|part| !part.is_empty()),
        );
        begin = at + 1;
    }
    parts.extend(Some(&stairs[begin..]).filter(|part| !part.is_empty()));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners found for a chain through the given corners.
    fn traced(corner_nodes: &[Node], is_closed: bool) -> Vec<(f64, f64)> {
        let mut nodes: Vec<Node> = Vec::new();
        let ends = corner_nodes.iter().copied().chain(is_closed.then_some(corner_nodes[0]));
        let ends: Vec<Node> = ends.collect();
        for pair in ends.windows(2) {
            let run = StraightRun { from: pair[0], to: pair[1] };
            let (x, y) = run.direction();
            nodes.extend((0..run.cells()).map(|at| (pair[0].0 + at * x, pair[0].1 + at * y)));
        }
        if !is_closed {
            nodes.extend(ends.last());
        }
        let place = |node: &Node| DVec2::new(node.0 as f64, node.1 as f64);
        let straighten = |nodes: &[Node]| match nodes {
            [first, .., last] => vec![place(first), place(last)],
            one => one.iter().map(place).collect(),
        };
        corners(&nodes, is_closed, straighten).iter().map(|at| (at.x, at.y)).collect()
    }

    fn as_places(nodes: &[Node]) -> Vec<(f64, f64)> {
        nodes.iter().map(|node| (node.0 as f64, node.1 as f64)).collect()
    }

    #[test]
    fn thin_walls_and_notches_are_kept() {
        for ring in [
            // A wall of one cell.
            &[(0, 0), (20, 0), (20, 1), (0, 1)][..],
            // A notch of one cell in a wall.
            &[(0, 0), (30, 0), (30, 10), (16, 10), (16, 9), (15, 9), (15, 10), (0, 10)],
            // A wall that continues offset by one cell.
            &[(0, 0), (15, 0), (15, 1), (30, 1), (30, 12), (0, 12)],
        ] {
            let found = traced(ring, true);
            assert_eq!(found, as_places(ring));
        }
        let open = [(0, 0), (0, 9), (1, 9), (1, 0)];
        assert_eq!(traced(&open, false), as_places(&open));
    }

    #[test]
    fn slanting_wall_has_two_faces() {
        // Stairs of three cells along each step, one cell thick.
        let steps = 8;
        let lower = (0..steps).flat_map(|step| [(3 * step, step), (3 * step + 3, step)]);
        let upper =
            (0..steps).rev().flat_map(|step| [(3 * step + 3, step + 1), (3 * step, step + 1)]);
        let ring: Vec<Node> = lower.chain(upper).collect();
        let found = traced(&ring, true);
        let expected = [(0, 0), (3 * steps, steps - 1), (3 * steps, steps), (0, 1)];
        assert_eq!(found, as_places(&expected));
    }

    #[test]
    fn stairs_become_one_wall() {
        let mut chain = vec![(0, 0), (40, 0)];
        for step in 0..8 {
            chain.extend([(40 + 2 * step, step + 1), (42 + 2 * step, step + 1)]);
        }
        chain.push((56, 40));
        let found = traced(&chain, false);
        assert_eq!(found.first(), Some(&(0.0, 0.0)));
        assert!(found.contains(&(40.0, 0.0)) && found.contains(&(56.0, 40.0)), "{found:?}");
        assert!(found.len() <= 6, "{found:?}");
    }
}
