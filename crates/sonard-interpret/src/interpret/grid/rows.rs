//! Corners of a chain of cells' sides, with walls along rows and columns kept where they are.
//!
//! A slanting wall shows as stairs: runs of sides that go in two directions only, turn by turn. A thin wall's end, a notch or
//! a jog does not. So only stairs of several steps are straightened.

use sonard_model::geometry::DVec2;

use super::trace::Node;

/// Stairs have so many runs at least; fewer are a jog between two walls.
const MIN_RUNS: usize = 6;
/// A run is a wall of its own if it is so long, in cells, and so much longer than its neighbours of the same direction.
const LONG_CELLS: i64 = 10;
const LONGER: i64 = 3;

/// A straight row of sides, from one corner to the next.
#[derive(Debug, Clone, Copy)]
struct Run {
    from: Node,
    to: Node,
}

impl Run {
    fn direction(self) -> Node {
        ((self.to.0 - self.from.0).signum(), (self.to.1 - self.from.1).signum())
    }

    fn cells(self) -> i64 {
        (self.to.0 - self.from.0).abs() + (self.to.1 - self.from.1).abs()
    }
}

/// The corners of a chain; `straighten` makes a line of the nodes of stairs, ends among them.
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
    for stairs in flights(&runs) {
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

/// The straight rows of a chain. A ring begins at its lowest corner on the left, so that no row is cut.
fn runs(nodes: &[Node], is_closed: bool) -> Vec<Run> {
    let mut nodes = nodes.to_vec();
    if is_closed {
        let lowest = (0..nodes.len()).min_by_key(|at| (nodes[*at].1, nodes[*at].0)).unwrap_or(0);
        nodes.rotate_left(lowest);
        nodes.extend(nodes.first().copied());
    }
    let mut runs: Vec<Run> = Vec::new();
    for ends in nodes.windows(2) {
        let side = Run { from: ends[0], to: ends[1] };
        match runs.last_mut() {
            Some(run) if run.direction() == side.direction() => run.to = side.to,
            _ => runs.push(side),
        }
    }
    runs
}

/// Runs that go in two directions only, none of them the opposite of the other.
fn flights(runs: &[Run]) -> Vec<&[Run]> {
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

/// Parts between runs that are walls of their own, and these.
fn split_at_walls(stairs: &[Run]) -> Vec<&[Run]> {
    let is_wall = |at: usize| {
        let own = stairs[at].cells();
        let beside = [at.checked_sub(2), Some(at + 2)];
        let beside = beside.into_iter().flatten().filter_map(|beside| stairs.get(beside));
        let longest = beside.map(|run| run.cells()).max().unwrap_or(0);
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

    /// A chain through these corners, and what becomes of it.
    fn traced(corner_nodes: &[Node], is_closed: bool) -> Vec<(f64, f64)> {
        let mut nodes: Vec<Node> = Vec::new();
        let ends = corner_nodes.iter().copied().chain(is_closed.then_some(corner_nodes[0]));
        let ends: Vec<Node> = ends.collect();
        for pair in ends.windows(2) {
            let run = Run { from: pair[0], to: pair[1] };
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
    fn thin_walls_notches_and_jogs_stay_where_they_are() {
        for ring in [
            // A wall of one cell.
            &[(0, 0), (20, 0), (20, 1), (0, 1)][..],
            // A notch of one cell in a wall.
            &[(0, 0), (30, 0), (30, 10), (16, 10), (16, 9), (15, 9), (15, 10), (0, 10)],
            // A wall that goes on a cell aside.
            &[(0, 0), (15, 0), (15, 1), (30, 1), (30, 12), (0, 12)],
        ] {
            let found = traced(ring, true);
            assert_eq!(found, as_places(ring));
        }
        let open = [(0, 0), (0, 9), (1, 9), (1, 0)];
        assert_eq!(traced(&open, false), as_places(&open));
    }

    #[test]
    fn stairs_become_one_wall_between_walls_that_stay() {
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
