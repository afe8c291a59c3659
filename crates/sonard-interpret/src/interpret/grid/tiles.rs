//! Unbounded grid of tiles, each allocated when evidence first reaches it.

use std::collections::BTreeMap;

use super::{Grid, GridShape, ScanEvidence};
use sonard_model::geometry::DVec2;

/// Cells along the side of a tile.
const SIDE: usize = 64;

/// Sparse grid of fixed-size tiles.
#[derive(Debug)]
pub(in super::super) struct Tiles {
    resolution_m: f64,
    max_cells: usize,
    /// Tiles by column and row from the world's origin.
    tiles: BTreeMap<(i64, i64), Grid>,
}

impl Tiles {
    /// Empty grid with room for so many cells.
    pub(in super::super) const fn new(resolution_m: f64, max_cells: usize) -> Self {
        Self { resolution_m, max_cells, tiles: BTreeMap::new() }
    }

    /// Number of allocated cells.
    #[cfg(test)]
    pub(in super::super) fn kept(&self) -> usize {
        self.tiles.len() * SIDE * SIDE
    }

    /// Removes all tiles.
    pub(in super::super) fn clear(&mut self) {
        self.tiles.clear();
    }

    /// Adds the readings of a scan, like [`Grid::add`]. Returns `false`, with the remaining
    /// readings dropped, if that requires more cells than allowed.
    pub(in super::super) fn add(&mut self, evidence: ScanEvidence<'_>) -> bool {
        for (from, table) in evidence.tables(self.resolution_m) {
            let place = from / self.resolution_m;
            let tile = |cell: f64| (cell / SIDE as f64).floor() as i64;
            let [low, high] = table.box_in_cells(self.resolution_m).map(|corner| place + corner);
            for row in tile(low.y)..=tile(high.y) {
                for column in tile(low.x)..=tile(high.x) {
                    let is_full = (self.tiles.len() + 1) * SIDE * SIDE > self.max_cells;
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

    /// Copies a region on the world's cells.
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

/// Cells along one axis that are shared by a tile and a part.
struct TileOverlap {
    of_tile: usize,
    of_part: usize,
    count: usize,
}

/// Overlap of a tile that starts `first` cells after the start of a part of `count` cells.
fn overlap(first: f64, count: usize) -> TileOverlap {
    let within = |cell: f64| cell.clamp(0.0, count as f64);
    let (start, end) = (within(first), within(first + SIDE as f64));
    let of_tile = (start - first).clamp(0.0, SIDE as f64) as usize;
    TileOverlap { of_tile, of_part: start as usize, count: (end - start) as usize }
}
