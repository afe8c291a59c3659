//! A grid without borders: pieces of the world's cells, each there from when something is said of it.

use std::collections::BTreeMap;

use super::{Grid, GridShape, Told};
use sonard_model::geometry::DVec2;

/// Cells along the side of a tile.
const SIDE: usize = 64;

/// What is known of cells, wherever they are.
#[derive(Debug)]
pub(in super::super) struct Tiles {
    resolution_m: f64,
    most_cells: usize,
    /// By column and row of tiles from the world's origin.
    tiles: BTreeMap<(i64, i64), Grid>,
}

impl Tiles {
    /// Nothing is known, and so many cells may be kept.
    pub(in super::super) const fn new(resolution_m: f64, most_cells: usize) -> Self {
        Self { resolution_m, most_cells, tiles: BTreeMap::new() }
    }

    /// How many cells are kept.
    #[cfg(test)]
    pub(in super::super) fn kept(&self) -> usize {
        self.tiles.len() * SIDE * SIDE
    }

    /// Forgets all.
    pub(in super::super) fn clear(&mut self) {
        self.tiles.clear();
    }

    /// Adds a set of readings, as [`Grid::add`] does; false, and the rest is left out, where that needs more cells than
    /// may be kept.
    pub(in super::super) fn add(&mut self, told: Told<'_>) -> bool {
        for (from, table) in told.tables(self.resolution_m) {
            let place = from / self.resolution_m;
            let tile = |cell: f64| (cell / SIDE as f64).floor() as i64;
            let [low, high] = table.box_in_cells(self.resolution_m).map(|corner| place + corner);
            for row in tile(low.y)..=tile(high.y) {
                for column in tile(low.x)..=tile(high.x) {
                    let is_full = (self.tiles.len() + 1) * SIDE * SIDE > self.most_cells;
                    if is_full && !self.tiles.contains_key(&(column, row)) {
                        return false;
                    }
                    let there = self.tiles.entry((column, row));
                    let grid = there.or_insert_with(|| empty(column, row, self.resolution_m));
                    table.add_to(&grid.shape, from, &mut grid.log_odds);
                }
            }
        }
        true
    }

    /// What is known of a region on the world's cells.
    pub(in super::super) fn part(&self, shape: GridShape) -> Grid {
        let (corner, _) = shape.corner_in_cells();
        let mut part = Grid::new(shape);
        for ((column, row), tile) in &self.tiles {
            let first = |tile: i64, corner: f64| tile as f64 * SIDE as f64 - corner;
            let columns = overlap(first(*column, corner.x), shape.width);
            let rows = overlap(first(*row, corner.y), shape.height);
            let width = columns.count;
            for at in 0..rows.count {
                let from = (rows.of_tile + at) * SIDE + columns.of_tile;
                let to = (rows.of_part + at) * shape.width + columns.of_part;
                part.log_odds[to..][..width].copy_from_slice(&tile.log_odds[from..][..width]);
            }
        }
        part
    }
}

fn empty(column: i64, row: i64, resolution_m: f64) -> Grid {
    let origin = DVec2::new(column as f64, row as f64) * SIDE as f64 * resolution_m;
    Grid::new(GridShape { origin, resolution_m, width: SIDE, height: SIDE })
}

/// Cells in a row that both a tile and a part have.
struct Overlap {
    of_tile: usize,
    of_part: usize,
    count: usize,
}

/// Of a tile that begins so many cells behind the beginning of a part of so many.
fn overlap(first: f64, count: usize) -> Overlap {
    let within = |cell: f64| cell.clamp(0.0, count as f64);
    let (start, end) = (within(first), within(first + SIDE as f64));
    let of_tile = (start - first).clamp(0.0, SIDE as f64) as usize;
    Overlap { of_tile, of_part: start as usize, count: (end - start) as usize }
}
