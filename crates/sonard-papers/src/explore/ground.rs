//! The floor as far as the robot knows it, and ways over it.

use std::collections::HashMap;

use pathfinding::prelude::{build_path, dijkstra_all};

use sonard_interpret::interpret::{grid::GridShape, lines::MapLine};
use sonard_model::geometry::DVec2;

/// Side of a cell, metres.
const CELL_M: f64 = 0.1;
/// The floor is planned for as far as this around what is known, metres.
const MARGIN_M: f64 = 1.5;
/// Ways keep this far from what stands there, if they can, metres.
const COMFORT_M: f64 = 0.6;
/// Around a place where it was the robot can always move, metres.
const TRODDEN_M: f64 = 0.15;

/// What is known of the floor from a place on it: unknown floor is taken to be free.
pub(super) struct Ground {
    shape: GridShape,
    /// Distance of each cell from what stands there, metres.
    clearance_m: Vec<f64>,
    passable: Vec<bool>,
    start: usize,
    /// For each cell that can be reached, the one before it and the cost of the way.
    ways: HashMap<usize, (usize, u32)>,
}

impl Ground {
    /// With lines and points that stand in the way of a body of this radius, and places where the
    /// robot has been; `None` if the floor is too large to plan for.
    pub(super) fn around(
        robot: DVec2,
        lines: &[MapLine],
        obstacles: &[DVec2],
        trodden: &[DVec2],
        radius_m: f64,
    ) -> Option<Self> {
        let known = || {
            let ends = lines.iter().flat_map(|line| line.ends);
            ends.chain(trodden.iter().copied()).chain([robot])
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
        let was_there =
            |at: DVec2| trodden.iter().chain([&robot]).any(|place| place.distance(at) < TRODDEN_M);
        let passable: Vec<bool> = clearance_m
            .iter()
            .enumerate()
            .map(|(cell, free_m)| *free_m >= radius_m || was_there(center(&shape, cell)))
            .collect();
        let start = shape.index_at(robot)?;
        let mut ground = Self { shape, clearance_m, passable, start, ways: HashMap::new() };
        ground.ways = dijkstra_all(&start, |cell| ground.neighbours(*cell));
        Some(ground)
    }

    /// Cost of the way to a place, roughly its length in centimetres; `None` if there is none.
    pub(super) fn cost(&self, to: DVec2) -> Option<u32> {
        let cell = self.shape.index_at(to)?;
        if cell == self.start { Some(0) } else { self.ways.get(&cell).map(|(_, cost)| *cost) }
    }

    /// Distance of a place from what stands there, metres; `None` beyond the floor.
    pub(super) fn clearance_m(&self, at: DVec2) -> Option<f64> {
        Some(self.clearance_m[self.shape.index_at(at)?])
    }

    /// Where to drive to, straight and at most this far, on the way to a place.
    pub(super) fn next(&self, robot: DVec2, to: DVec2, most_m: f64) -> Option<DVec2> {
        let cell = self.shape.index_at(to)?;
        if cell == self.start {
            return Some(to);
        }
        self.ways.get(&cell)?;
        let mut way: Vec<DVec2> =
            build_path(&cell, &self.ways).into_iter().map(|at| center(&self.shape, at)).collect();
        if let Some(last) = way.last_mut() {
            *last = to;
        }
        let near = way.iter().skip(1).take_while(|at| at.distance(robot) <= most_m);
        let straight = near.filter(|at| self.is_free(robot, **at)).last();
        straight.or(way.get(1)).copied()
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
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        around
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
