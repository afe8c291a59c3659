//! Ideal map of a scene.

use super::{Grid, GridShape};
use sonard_model::{geometry::DVec2, scene::Scene};

/// Rasterizes a scene: cells touched by a wall or a cylinder are occupied, cells reachable
/// from one of `places` without crossing those are free, all others unknown.
#[must_use]
pub fn ideal(scene: &Scene, shape: GridShape, places: &[DVec2]) -> Grid {
    let mut cells = vec![0.5; shape.cells()];
    for wall in &scene.walls {
        draw_wall(&shape, &mut cells, wall.a, wall.b);
    }
    for cylinder in &scene.cylinders {
        draw_disc(&shape, &mut cells, cylinder.center, cylinder.radius_m);
    }
    let mut open: Vec<usize> = places.iter().filter_map(|place| shape.index_at(*place)).collect();
    while let Some(at) = open.pop() {
        if cells[at] != 0.5 {
            continue;
        }
        cells[at] = 0.0;
        let (column, row) = (at % shape.width, at / shape.width);
        let sides = [
            (column > 0, at.wrapping_sub(1)),
            (column + 1 < shape.width, at + 1),
            (row > 0, at.wrapping_sub(shape.width)),
            (row + 1 < shape.height, at + shape.width),
        ];
        open.extend(sides.into_iter().filter(|(inside, _)| *inside).map(|(_, side)| side));
    }
    Grid::from_probabilities(shape, &cells)
}

/// Marks the cells crossed by a segment. Steps are short enough to leave no gap for a
/// 4-connected path.
fn draw_wall(shape: &GridShape, cells: &mut [f64], a: DVec2, b: DVec2) {
    let steps = (a.distance(b) / (0.1 * shape.resolution_m)).ceil().max(1.0);
    for step in 0..=steps as usize {
        let at = a + (step as f64 / steps) * (b - a);
        if let Some(index) = shape.index_at(at) {
            cells[index] = 1.0;
        }
    }
}

fn draw_disc(shape: &GridShape, cells: &mut [f64], center: DVec2, radius_m: f64) {
    let reach = radius_m.max(shape.resolution_m / 2.0);
    for row in 0..shape.height {
        for column in 0..shape.width {
            if shape.center(column, row).distance(center) <= reach {
                cells[row * shape.width + column] = 1.0;
            }
        }
    }
}
