//! Known floor around the robot, with paths over it.

use std::collections::HashMap;

use pathfinding::prelude::{build_path, dijkstra_all};

use sonard_interpret::interpret::{grid::GridShape, lines::MapLine};
use sonard_model::geometry::DVec2;

/// Side of a cell, metres.
const CELL_M: f64 = 0.1;
/// Margin of the planning grid around known lines and positions, metres.
const MARGIN_M: f64 = 1.5;
/// Distance from obstacles below which paths cost more, metres.
const COMFORT_M: f64 = 0.6;
/// Radius around visited positions in which the floor is passable, metres.
const VISITED_M: f64 = 0.15;

/// Planning grid of the floor with shortest paths from the robot. Unknown floor counts as free.
pub(super) struct FloorGrid {
    shape: GridShape,
    /// Distance of each cell from the nearest obstacle, metres.
    clearance_m: Vec<f64>,
    passable: Vec<bool>,
    start: usize,
    /// Predecessor and path cost of each reachable cell.
    paths: HashMap<usize, (usize, u32)>,
}

impl FloorGrid {
    /// Grid with lines and points as obstacles for a body of this radius. Visited positions stay
    /// passable. `None` if the floor is too large for the grid.
    pub(super) fn around(
        robot: DVec2,
        lines: &[MapLine],
        obstacles: &[DVec2],
        visited: &[DVec2],
        radius_m: f64,
    ) -> Option<Self> {
        let known = || {
            let ends = lines.iter().flat_map(|line| line.ends);
            ends.chain(visited.iter().copied()).chain([robot])
        };
        let low = known().fold(robot, DVec2::min) - MARGIN_M;
        let high = known().fold(robot, DVec2::max) + MARGIN_M;
        let shape = GridShape::covering(low, high, CELL_M).ok()?;
        let places = (0..shape.cells()).map(|cell| center(&shape, cell));
        let clearance_m: Vec<f64> = places
            .map(|at| {
                let walls = lines.iter().map(|line| line.distance_m(at));
                let points = obstacles.iter().map(|point| point.distance(at));
                walls.chain(points).fold(f64::INFINITY, f64::min)
            })
            .collect();
        let was_visited =
            |at: DVec2| visited.iter().chain([&robot]).any(|place| place.distance(at) < VISITED_M);
        let passable: Vec<bool> = clearance_m
            .iter()
            .enumerate()
            .map(|(cell, free_m)| *free_m >= radius_m || was_visited(center(&shape, cell)))
            .collect();
        let start = shape.index_at(robot)?;
        let mut ground = Self { shape, clearance_m, passable, start, paths: HashMap::new() };
        ground.paths = dijkstra_all(&start, |cell| ground.neighbours(*cell));
        Some(ground)
    }

    /// Path cost to a position, roughly its length in centimetres; `None` if unreachable.
    pub(super) fn cost(&self, to: DVec2) -> Option<u32> {
        let cell = self.shape.index_at(to)?;
        if cell == self.start { Some(0) } else { self.paths.get(&cell).map(|(_, cost)| *cost) }
    }

    /// Distance of a position from the nearest obstacle, metres; `None` outside the grid.
    pub(super) fn clearance_m(&self, at: DVec2) -> Option<f64> {
        Some(self.clearance_m[self.shape.index_at(at)?])
    }

    /// Farthest point of the path to a position within `max_m` that a straight drive reaches.
    pub(super) fn next(&self, robot: DVec2, to: DVec2, max_m: f64) -> Option<DVec2> {
        let cell = self.shape.index_at(to)?;
        if cell == self.start {
            return Some(to);
        }
        self.paths.get(&cell)?;
        let mut path: Vec<DVec2> =
            build_path(&cell, &self.paths).into_iter().map(|at| center(&self.shape, at)).collect();
        if let Some(last) = path.last_mut() {
            *last = to;
        }
        let near = path.iter().skip(1).take_while(|at| at.distance(robot) <= max_m);
        let straight = near.filter(|at| self.is_free(robot, **at)).last();
        straight.or(path.get(1)).copied()
    }

    fn is_free(&self, from: DVec2, to: DVec2) -> bool {
        let steps = (from.distance(to) / (CELL_M / 2.0)).ceil().max(1.0);
        (0..=steps as usize).all(|step| {
            let at = from.lerp(to, step as f64 / steps);
            self.shape.index_at(at).is_some_and(|cell| self.passable[cell])
        })
    }

    fn neighbours(&self, cell: usize) -> Vec<(usize, u32)> {
        let (column, row) = ((cell % self.shape.width) as i64, (cell / self.shape.width) as i64);
        let neighbourhood = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        neighbourhood
            .filter(|step| *step != (0, 0))
            .filter_map(|(dx, dy)| {
                let (x, y) = (usize::try_from(column + dx).ok()?, usize::try_from(row + dy).ok()?);
                let inside = x < self.shape.width && y < self.shape.height;
                let next = inside.then_some(y * self.shape.width + x)?;
                let length_cm = if dx != 0 && dy != 0 { 14.0 } else { 10.0 };
                let tight = (COMFORT_M - self.clearance_m[next]).max(0.0) / COMFORT_M;
                self.passable[next].then_some((next, (length_cm * (1.0 + 3.0 * tight)) as u32))
            })
            .collect()
    }
}

fn center(shape: &GridShape, cell: usize) -> DVec2 {
    shape.center(cell % shape.width, cell / shape.width)
}
