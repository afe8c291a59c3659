//! Walls of a map: boundaries between occupied and free cells, traced and simplified.

use std::collections::HashMap;

use super::{Grid, rows};
use sonard_model::geometry::{DVec2, distance_to_segment, enclosed_area};

/// Polyline along walls, with free space on its left.
#[derive(Debug, Clone, PartialEq)]
pub struct TracedLine {
    /// Corners, metres.
    pub corners: Vec<DVec2>,
    /// Whether a wall leads from the last corner back to the first.
    pub is_closed: bool,
}

/// Settings of the tracing of walls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TraceSettings {
    /// Cells above this probability are occupied.
    pub occupied: f64,
    /// Cells below this probability are free.
    pub free: f64,
    /// Maximum number of consecutive undecided cells between occupied and free ones that count as
    /// free: in a sonar map, free space fades out before walls.
    pub gap_cells: usize,
    /// Maximum distance of a cell side from the wall that represents it, metres. Less than the
    /// diagonal of a cell leaves steps in walls that do not run along the rows.
    pub tolerance_m: f64,
    /// Minimum length of a line, metres; shorter ones are specks.
    pub min_length_m: f64,
    /// Keep walls along rows and columns of cells in place: only stairs become slanting walls.
    pub keeps_rows: bool,
}

impl TraceSettings {
    /// Settings for a map with cells of this size.
    #[must_use]
    pub const fn for_cells(resolution_m: f64) -> Self {
        Self {
            occupied: 0.65,
            free: 0.49,
            gap_cells: 2,
            tolerance_m: 1.5 * resolution_m,
            min_length_m: 4.0 * resolution_m,
            keeps_rows: false,
        }
    }
}

/// Corner of cells: column and row of the cell of which it is the lower left corner.
pub(super) type Node = (i64, i64);

/// Traces the walls of a map.
///
/// A wall is a boundary between occupied and free cells; with unknown cells behind it, it has a
/// single face. Occupied cells that touch at a corner are connected. Lines are simplified with the
/// Douglas-Peucker algorithm.
#[must_use]
pub fn trace(grid: &Grid, settings: &TraceSettings) -> Vec<TracedLine> {
    let shape = grid.shape();
    let place =
        |node: &Node| shape.origin + shape.resolution_m * DVec2::new(node.0 as f64, node.1 as f64);
    let lines = chains(&sides(grid, settings)).into_iter().filter_map(|(nodes, is_closed)| {
        let points: Vec<DVec2> = nodes.iter().map(place).collect();
        let line = match (settings.keeps_rows, is_closed) {
            (true, _) => rows::corners(&nodes, is_closed, |stairs| {
                let points: Vec<DVec2> = stairs.iter().map(place).collect();
                straightened(&points, settings.tolerance_m)
            }),
            (false, true) => straightened_ring(&points, settings.tolerance_m),
            (false, false) => straightened(&points, settings.tolerance_m),
        };
        let length_m = (points.len() - usize::from(!is_closed)) as f64 * shape.resolution_m;
        // A ring thinner than the tolerance degenerates to a line without area.
        let is_ring = is_closed && line.len() > 2 && enclosed_area(&line) != 0.0;
        (length_m >= settings.min_length_m && line.len() > 1)
            .then_some(TracedLine { corners: line, is_closed: is_ring })
    });
    lines.collect()
}

/// Cell sides with an occupied cell on the right and a free one on the left, from node to node.
fn sides(grid: &Grid, settings: &TraceSettings) -> Vec<(Node, Node)> {
    let shape = grid.shape();
    let (width, height) = (shape.width as i64, shape.height as i64);
    let free = free_cells(grid, settings);
    let index = |(column, row): Node| (row * width + column) as usize;
    let is_inside = |(column, row): &Node| (0..width).contains(column) && (0..height).contains(row);
    let is_occupied = |cell: Node| grid.probability(index(cell)) > settings.occupied;
    let is_free = |cell: Node| is_inside(&cell) && free[index(cell)];
    let mut sides = Vec::new();
    for row in 0..height {
        for column in (0..width).filter(|column| is_occupied((*column, row))) {
            let (left, right, below, above) = (column, column + 1, row, row + 1);
            // Clockwise around the occupied cell, so that it is on the right.
            let round = [
                ((column - 1, row), (left, below), (left, above)),
                ((column, row + 1), (left, above), (right, above)),
                ((column + 1, row), (right, above), (right, below)),
                ((column, row - 1), (right, below), (left, below)),
            ];
            let free_sides = round.into_iter().filter(|(neighbour, ..)| is_free(*neighbour));
            sides.extend(free_sides.map(|(_, from, to)| (from, to)));
        }
    }
    sides
}

/// Marks free cells, and undecided ones within `gap_cells` of a free one with no occupied between.
fn free_cells(grid: &Grid, settings: &TraceSettings) -> Vec<bool> {
    let (width, cells) = (grid.shape().width, grid.shape().cells());
    let mut is_free: Vec<bool> =
        (0..cells).map(|cell| grid.probability(cell) < settings.free).collect();
    let mut edge: Vec<usize> = (0..cells).filter(|cell| is_free[*cell]).collect();
    for _ in 0..settings.gap_cells {
        let mut next = Vec::new();
        for cell in edge {
            let (column, row) = (cell % width, cell / width);
            // 4-connected: walls of cells that touch at corners have no holes.
            let neighbours = [
                (column > 0).then(|| cell - 1),
                (column + 1 < width).then_some(cell + 1),
                (row > 0).then(|| cell - width),
                Some(cell + width).filter(|above| *above < cells),
            ];
            for near in neighbours.into_iter().flatten() {
                if !is_free[near] && grid.probability(near) <= settings.occupied {
                    is_free[near] = true;
                    next.push(near);
                }
            }
        }
        edge = next;
    }
    is_free
}

/// Joins sides end to end: ordered nodes, and whether the last connects to the first.
fn chains(sides: &[(Node, Node)]) -> Vec<(Vec<Node>, bool)> {
    let mut leaving: HashMap<Node, Vec<usize>> = HashMap::new();
    let mut arriving: HashMap<Node, usize> = HashMap::new();
    for (index, (from, to)) in sides.iter().enumerate() {
        leaving.entry(*from).or_default().push(index);
        *arriving.entry(*to).or_default() += 1;
    }
    // Open lines are followed from their start, rings from anywhere.
    let is_start = |side: &(Node, Node)| {
        let (out, into) = (leaving[&side.0].len(), arriving.get(&side.0).copied().unwrap_or(0));
        out > into
    };
    let mut starts: Vec<usize> = (0..sides.len()).collect();
    starts.sort_by_key(|index| (!is_start(&sides[*index]), *index));
    let mut is_taken = vec![false; sides.len()];
    let mut all = Vec::new();
    for start in starts {
        if is_taken[start] {
            continue;
        }
        let (first, mut at) = (sides[start].0, start);
        let mut nodes = vec![first];
        loop {
            is_taken[at] = true;
            let (from, node) = sides[at];
            if node == first {
                all.push((nodes, true));
                break;
            }
            nodes.push(node);
            let next = leaving.get(&node).into_iter().flatten().filter(|side| !is_taken[**side]);
            // The sharpest turn to the left stays with the same free cell.
            let Some(next) = next.max_by_key(|side| turn(from, node, sides[**side].1)) else {
                all.push((nodes, false));
                break;
            };
            at = *next;
        }
    }
    all
}

/// Returns 1 for a left turn, 0 straight on, -1 for a right turn.
fn turn(from: Node, at: Node, to: Node) -> i64 {
    ((at.0 - from.0) * (to.1 - at.1) - (at.1 - from.1) * (to.0 - at.0)).signum()
}

/// Simplifies a ring, cut at its widest into two halves.
fn straightened_ring(points: &[DVec2], tolerance_m: f64) -> Vec<DVec2> {
    let middle = points.iter().sum::<DVec2>() / points.len() as f64;
    let farthest = |from: DVec2| {
        let far = |a: &usize, b: &usize| {
            from.distance_squared(points[*a]).total_cmp(&from.distance_squared(points[*b]))
        };
        (0..points.len()).max_by(far).unwrap_or_default()
    };
    let first = farthest(middle);
    let turned: Vec<DVec2> = points[first..].iter().chain(&points[..=first]).copied().collect();
    let opposite = farthest(points[first]);
    let opposite = (opposite + points.len() - first) % points.len();
    let mut ring = straightened(&turned[..=opposite], tolerance_m);
    ring.pop();
    ring.extend(straightened(&turned[opposite..], tolerance_m));
    ring.pop();
    ring
}

/// Simplifies a polyline with the Douglas-Peucker algorithm, ends included.
fn straightened(points: &[DVec2], tolerance_m: f64) -> Vec<DVec2> {
    let mut is_kept = vec![false; points.len()];
    let Some(last) = points.len().checked_sub(1) else { return Vec::new() };
    (is_kept[0], is_kept[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        let off = |index: &usize| match points[from] == points[to] {
            true => points[*index].distance(points[from]),
            false => distance_to_segment(points[*index], points[from], points[to]),
        };
        let worst = (from + 1..to).max_by(|a, b| off(a).total_cmp(&off(b)));
        if let Some(worst) = worst.filter(|worst| off(worst) > tolerance_m) {
            is_kept[worst] = true;
            open.extend([(from, worst), (worst, to)]);
        }
    }
    points.iter().zip(is_kept).filter_map(|(point, is_kept)| is_kept.then_some(*point)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpret::grid::{GridShape, ideal};
    use sonard_model::scene::Scene;

    fn traced(scene: &Scene, resolution_m: f64, start: [f64; 2]) -> Vec<TracedLine> {
        let ends = || scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
        let margin = DVec2::splat(0.3);
        let low = ends().reduce(DVec2::min).expect("walls") - margin;
        let high = ends().reduce(DVec2::max).expect("walls") + margin;
        let shape = GridShape::covering(low, high, resolution_m).expect("a grid");
        let grid = ideal(scene, shape, &[start.into()]);
        trace(&grid, &TraceSettings::for_cells(resolution_m))
    }

    #[test]
    fn rotated_room_with_box_is_traced() {
        let turn = DVec2::from_angle(0.3);
        let turned =
            |corners: [[f64; 2]; 4]| corners.map(|corner| turn.rotate(corner.into()).into());
        let room = turned([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]);
        let inner = turned([[1.5, 1.0], [2.5, 1.0], [2.5, 2.0], [1.5, 2.0]]);
        let scene = Scene::builder("room")
            .material("wall", 1.0)
            .room("room", &room, "wall")
            .room("box", &inner, "wall")
            .build()
            .expect("a scene");
        let lines = traced(&scene, 0.02, turn.rotate(DVec2::new(0.5, 0.5)).into());
        assert_eq!(lines.len(), 2, "{lines:#?}");
        for line in &lines {
            assert!(line.is_closed && (4..=8).contains(&line.corners.len()), "{line:?}");
            for corner in &line.corners {
                let off =
                    |wall: &sonard_model::scene::Wall| distance_to_segment(*corner, wall.a, wall.b);
                let off_m = scene.walls.iter().map(off).fold(f64::INFINITY, f64::min);
                assert!(off_m < 0.04, "{corner} is {off_m} m off");
            }
        }
        // Free space is inside the room and outside the box: on the left of both.
        let mut areas: Vec<f64> = lines.iter().map(|line| signed_area(&line.corners)).collect();
        areas.sort_by(f64::total_cmp);
        assert!((areas[0] + 1.0).abs() < 0.15 && (areas[1] - 12.0).abs() < 0.4, "{areas:?}");
    }

    fn signed_area(corners: &[DVec2]) -> f64 {
        let next = corners.iter().cycle().skip(1);
        0.5 * corners.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum::<f64>()
    }

    #[test]
    fn diagonals_have_no_holes() {
        let shape = GridShape::covering(DVec2::ZERO, DVec2::splat(5.0), 1.0).expect("a grid");
        let mut cells = vec![0.0; 25];
        for at in 0..5 {
            cells[at * 5 + at] = 1.0;
        }
        let settings =
            TraceSettings { min_length_m: 0.0, tolerance_m: 0.0, ..TraceSettings::for_cells(1.0) };
        let lines = trace(&Grid::from_probabilities(shape, &cells), &settings);
        // One line above the diagonal and one below.
        assert_eq!(lines.len(), 2, "{lines:#?}");
        // A wall with unknown cells on one side has a single face.
        let mut cells = vec![0.5; 25];
        cells[10..15].fill(1.0);
        cells[15..25].fill(0.0);
        let lines = trace(&Grid::from_probabilities(shape, &cells), &settings);
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].corners, [DVec2::new(0.0, 3.0), DVec2::new(5.0, 3.0)]);
        // Cells that fade out before a wall are free; those fading farther away belong to no wall.
        let mut cells = vec![0.5; 25];
        cells[20..25].fill(1.0);
        cells[5..10].fill(0.2);
        assert_eq!(trace(&Grid::from_probabilities(shape, &cells), &settings).len(), 1);
        cells[5..10].fill(0.5);
        cells[..5].fill(0.2);
        assert_eq!(trace(&Grid::from_probabilities(shape, &cells), &settings), []);
        // Specks are dropped on request.
        let mut cells = vec![0.0; 25];
        cells[12] = 1.0;
        let grid = Grid::from_probabilities(shape, &cells);
        assert_eq!(trace(&grid, &settings).len(), 1);
        assert_eq!(trace(&grid, &TraceSettings { min_length_m: 5.0, ..settings }), []);
    }
}
