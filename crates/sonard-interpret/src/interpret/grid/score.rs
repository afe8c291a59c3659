//! Map quality: the four benchmarks of the Feature Prediction paper.

use std::{cmp::Reverse, collections::BinaryHeap};

use serde::Serialize;
use thiserror::Error;

use super::{Grid, GridShape};

/// Results of the four benchmarks, each in percent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct MapScore {
    /// Baron's correlation of the two maps, `(mean(M N) - mean(M) mean(N)) / (sigma(M)
    /// sigma(N))`; more is better. `None` for a constant map.
    pub correlation_percent: Option<f64>,
    /// Sum of squared differences (Martin and Moravec) over the number of cells; less is better.
    pub map_score_percent: f64,
    /// Sum of squared differences over cells occupied (above 0.5) in either map, over the number of
    /// all cells. The paper's figures fit that reading: each is below the one over all cells.
    pub map_score_occupied_percent: f64,
    /// Sum of squared differences over cells occupied in either map, over the number of those.
    pub map_score_of_occupied_percent: Option<f64>,
    /// Fraction of the shortest paths through the map's free space, between points of a lattice,
    /// that hit an obstacle of the ideal map; less is better. `None` without a path.
    pub false_positive_paths_percent: Option<f64>,
    /// Number of paths tried.
    pub paths: u64,
}

/// Settings of the path benchmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathSettings {
    /// Spacing of the lattice, metres.
    pub spacing_m: f64,
    /// Maximum number of start points.
    pub max_starts: usize,
    /// Cells below this probability are free; unknown ones (0.5) are not.
    pub free_below: f64,
}

impl Default for PathSettings {
    fn default() -> Self {
        Self { spacing_m: 0.5, max_starts: 64, free_below: 0.45 }
    }
}

/// Maps that cannot be compared.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ScoreError {
    /// Different position, size or resolution.
    #[error(
        "the maps differ in position, size or resolution: {}x{} cells of {} m from ({}, {}) \
         against {}x{} of {} m from ({}, {})",
        map.width, map.height, map.resolution_m, map.origin.x, map.origin.y,
        ideal.width, ideal.height, ideal.resolution_m, ideal.origin.x, ideal.origin.y
    )]
    Shape {
        /// Shape of the map.
        map: GridShape,
        /// Shape of the ideal map.
        ideal: GridShape,
    },
}

/// Scores a map against the ideal one.
///
/// # Errors
/// Maps of different position, size or resolution.
pub fn score(map: &Grid, ideal: &Grid, paths: &PathSettings) -> Result<MapScore, ScoreError> {
    let (shape, expected) = (*map.shape(), *ideal.shape());
    let near = |a: f64, b: f64| (a - b).abs() < 1e-6 * shape.resolution_m;
    let same = (shape.width, shape.height) == (expected.width, expected.height)
        && near(shape.resolution_m, expected.resolution_m)
        && near(shape.origin.x, expected.origin.x)
        && near(shape.origin.y, expected.origin.y);
    if !same {
        return Err(ScoreError::Shape { map: shape, ideal: expected });
    }
    let map: Vec<f64> = map.probabilities().collect();
    let ideal: Vec<f64> = ideal.probabilities().collect();
    let count = map.len() as f64;
    let square = |(m, n): (&f64, &f64)| (m - n).powi(2);
    let all: f64 = map.iter().zip(&ideal).map(square).sum();
    let occupied: Vec<(&f64, &f64)> =
        map.iter().zip(&ideal).filter(|(m, n)| **m > 0.5 || **n > 0.5).collect();
    let of_occupied: f64 = occupied.iter().copied().map(square).sum();
    let (false_paths, tried) = false_paths(&shape, &map, &ideal, paths);
    let share = |part: f64, whole: f64| (whole > 0.0).then(|| 100.0 * part / whole);
    Ok(MapScore {
        correlation_percent: correlation(&map, &ideal).map(|r| 100.0 * r),
        map_score_percent: 100.0 * all / count,
        map_score_occupied_percent: 100.0 * of_occupied / count,
        map_score_of_occupied_percent: share(of_occupied, occupied.len() as f64),
        false_positive_paths_percent: share(false_paths as f64, tried as f64),
        paths: tried,
    })
}

fn correlation(map: &[f64], ideal: &[f64]) -> Option<f64> {
    let count = map.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let (map_mean, ideal_mean) = (mean(map), mean(ideal));
    let (mut covariance, mut map_variance, mut ideal_variance) = (0.0, 0.0, 0.0);
    for (m, n) in map.iter().zip(ideal) {
        covariance += (m - map_mean) * (n - ideal_mean);
        map_variance += (m - map_mean).powi(2);
        ideal_variance += (n - ideal_mean).powi(2);
    }
    // The variance of a constant map is a rounding error.
    let varies = map_variance > 1e-12 * count && ideal_variance > 1e-12 * count;
    varies.then(|| covariance / (map_variance * ideal_variance).sqrt())
}

/// Number of paths that hit an obstacle, and number of paths.
fn false_paths(
    shape: &GridShape,
    map: &[f64],
    ideal: &[f64],
    settings: &PathSettings,
) -> (u64, u64) {
    let free: Vec<bool> = map.iter().map(|p| *p < settings.free_below).collect();
    let wall: Vec<bool> = ideal.iter().map(|p| *p > 0.5).collect();
    let stride = (settings.spacing_m / shape.resolution_m).round().max(1.0) as usize;
    let lattice: Vec<usize> = (stride / 2..shape.height)
        .step_by(stride)
        .flat_map(|row| {
            (stride / 2..shape.width).step_by(stride).map(move |column| row * shape.width + column)
        })
        .filter(|at| free[*at])
        .collect();
    let every = lattice.len().div_ceil(settings.max_starts.max(1)).max(1);
    let (mut hit, mut tried) = (0, 0);
    for (number, &start) in lattice.iter().enumerate().step_by(every) {
        let paths = ShortestPaths::from_start(shape, &free, &wall, start);
        // Count each pair once, unless only its end is among the chosen starts.
        for (other, &end) in lattice.iter().enumerate() {
            if other != number && (other > number || other % every != 0) && paths.reached[end] {
                tried += 1;
                hit += u64::from(paths.hits[end]);
            }
        }
    }
    (hit, tried)
}

/// Shortest paths from one cell to all others through free space, 8-connected (Dijkstra).
struct ShortestPaths {
    reached: Vec<bool>,
    /// Whether the path to a cell crosses an obstacle of the ideal map.
    hits: Vec<bool>,
}

impl ShortestPaths {
    fn from_start(shape: &GridShape, free: &[bool], wall: &[bool], start: usize) -> Self {
        let mut cost = vec![u32::MAX; free.len()];
        let mut paths = Self { reached: vec![false; free.len()], hits: vec![false; free.len()] };
        let mut open = BinaryHeap::from([Reverse((0_u32, start))]);
        cost[start] = 0;
        paths.hits[start] = wall[start];
        while let Some(Reverse((so_far, at))) = open.pop() {
            if std::mem::replace(&mut paths.reached[at], true) {
                continue;
            }
            for (next, step) in neighbours(shape, at) {
                let reached = so_far + step;
                if free[next] && reached < cost[next] {
                    cost[next] = reached;
                    paths.hits[next] = paths.hits[at] || wall[next];
                    open.push(Reverse((reached, next)));
                }
            }
        }
        paths
    }
}

/// Neighbouring cells with the length of the step, in fifths of a cell's side.
fn neighbours(shape: &GridShape, at: usize) -> impl Iterator<Item = (usize, u32)> {
    let (width, height) = (shape.width as i64, shape.height as i64);
    let (column, row) = (at as i64 % width, at as i64 / width);
    let steps = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
    steps.into_iter().filter_map(move |(dx, dy)| {
        let (x, y) = (column + dx, row + dy);
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        inside.then_some(((y * width + x) as usize, if dx == 0 || dy == 0 { 5 } else { 7 }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sonard_model::geometry::DVec2;

    /// Cells of 3 by 3: all eight around the middle, three at a corner.
    #[test]
    fn neighbours_are_inside() {
        let shape = GridShape { origin: DVec2::ZERO, resolution_m: 0.1, width: 3, height: 3 };
        let of = |at: usize| {
            let mut found: Vec<(usize, u32)> = neighbours(&shape, at).collect();
            found.sort_unstable();
            found
        };
        let around = [(0, 7), (1, 5), (2, 7), (3, 5), (5, 5), (6, 7), (7, 5), (8, 7)];
        assert_eq!(of(4), around);
        assert_eq!(of(0), [(1, 5), (3, 5), (4, 7)]);
        assert_eq!(of(5), [(1, 7), (2, 5), (4, 5), (7, 7), (8, 5)]);
        assert_eq!(of(8), [(4, 7), (5, 5), (7, 5)]);
    }
}
