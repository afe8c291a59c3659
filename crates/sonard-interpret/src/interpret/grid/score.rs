//! How good a map is: the four benchmarks that Feature Prediction was measured with.

use std::{cmp::Reverse, collections::BinaryHeap};

use serde::Serialize;
use thiserror::Error;

use super::{Grid, GridShape};

/// The four benchmarks, each in percent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct MapScore {
    /// Baron's correlation of the two maps, `(mean(M N) - mean(M) mean(N)) / (sigma(M)
    /// sigma(N))`; more is better. `None` where a map is the same everywhere.
    pub correlation_percent: Option<f64>,
    /// Sum of squared differences (Martin and Moravec) over the number of cells; less is better.
    pub map_score_percent: f64,
    /// The same sum over those cells only that are occupied (above 0.5) in one of the maps, still
    /// over the number of all cells: the paper's figures, each below the one over all cells, fit
    /// that reading.
    pub map_score_occupied_percent: f64,
    /// And over the number of those cells.
    pub map_score_of_occupied_percent: Option<f64>,
    /// Of the shortest ways through the map's free space between places on a lattice, how many
    /// run into an obstacle of the ideal map; less is better. `None` without a way.
    pub false_positive_paths_percent: Option<f64>,
    /// How many ways were tried.
    pub paths: u64,
}

/// The paths that are tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathSettings {
    /// From place to place of the lattice, metres.
    pub spacing_m: f64,
    /// Most places that ways begin at.
    pub most_starts: usize,
    /// Cells up to this probability are free; unknown ones (0.5) are not.
    pub free_below: f64,
}

impl Default for PathSettings {
    fn default() -> Self {
        Self { spacing_m: 0.5, most_starts: 64, free_below: 0.45 }
    }
}

/// Maps that cannot be compared.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ScoreError {
    /// They don't lie on each other.
    #[error(
        "the maps differ in place or fineness: {}x{} cells of {} m from ({}, {}) against {}x{} of \
         {} m from ({}, {})",
        one.width, one.height, one.resolution_m, one.origin.x, one.origin.y,
        other.width, other.height, other.resolution_m, other.origin.x, other.origin.y
    )]
    Shape {
        /// The map's.
        one: GridShape,
        /// The ideal's.
        other: GridShape,
    },
}

/// Sets a map beside the ideal one.
///
/// # Errors
/// When the two differ in place, size or resolution.
pub fn score(map: &Grid, ideal: &Grid, paths: &PathSettings) -> Result<MapScore, ScoreError> {
    let (one, other) = (*map.shape(), *ideal.shape());
    let near = |a: f64, b: f64| (a - b).abs() < 1e-6 * one.resolution_m;
    let same = (one.width, one.height) == (other.width, other.height)
        && near(one.resolution_m, other.resolution_m)
        && near(one.origin.x, other.origin.x)
        && near(one.origin.y, other.origin.y);
    if !same {
        return Err(ScoreError::Shape { one, other });
    }
    let map: Vec<f64> = map.probabilities().collect();
    let ideal: Vec<f64> = ideal.probabilities().collect();
    let count = map.len() as f64;
    let square = |(m, n): (&f64, &f64)| (m - n).powi(2);
    let all: f64 = map.iter().zip(&ideal).map(square).sum();
    let occupied: Vec<(&f64, &f64)> =
        map.iter().zip(&ideal).filter(|(m, n)| **m > 0.5 || **n > 0.5).collect();
    let of_occupied: f64 = occupied.iter().copied().map(square).sum();
    let (false_paths, tried) = false_paths(&one, &map, &ideal, paths);
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

fn correlation(one: &[f64], other: &[f64]) -> Option<f64> {
    let count = one.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let (a, b) = (mean(one), mean(other));
    let (mut both, mut of_one, mut of_other) = (0.0, 0.0, 0.0);
    for (m, n) in one.iter().zip(other) {
        both += (m - a) * (n - b);
        of_one += (m - a).powi(2);
        of_other += (n - b).powi(2);
    }
    // A map that is the same everywhere has no deviation but rounding.
    let deviates = of_one > 1e-12 * count && of_other > 1e-12 * count;
    deviates.then(|| both / (of_one * of_other).sqrt())
}

/// How many of the ways run into something, and how many there are.
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
    let every = lattice.len().div_ceil(settings.most_starts.max(1)).max(1);
    let (mut hit, mut tried) = (0, 0);
    for (number, &start) in lattice.iter().enumerate().step_by(every) {
        let ways = Ways::from(shape, &free, &wall, start);
        // Each pair once, unless it begins at one of the chosen starts only.
        for (other, &end) in lattice.iter().enumerate() {
            if other != number && (other > number || other % every != 0) && ways.reached[end] {
                tried += 1;
                hit += u64::from(ways.hits[end]);
            }
        }
    }
    (hit, tried)
}

/// Shortest ways from one cell to all others through free space, by sides and corners.
struct Ways {
    reached: Vec<bool>,
    /// Whether the way to a cell goes through an obstacle of the ideal map.
    hits: Vec<bool>,
}

impl Ways {
    fn from(shape: &GridShape, free: &[bool], wall: &[bool], start: usize) -> Self {
        let mut cost = vec![u32::MAX; free.len()];
        let mut ways = Self { reached: vec![false; free.len()], hits: vec![false; free.len()] };
        let mut open = BinaryHeap::from([Reverse((0_u32, start))]);
        cost[start] = 0;
        ways.hits[start] = wall[start];
        while let Some(Reverse((so_far, at))) = open.pop() {
            if std::mem::replace(&mut ways.reached[at], true) {
                continue;
            }
            for (next, step) in neighbours(shape, at) {
                let reached = so_far + step;
                if free[next] && reached < cost[next] {
                    cost[next] = reached;
                    ways.hits[next] = ways.hits[at] || wall[next];
                    open.push(Reverse((reached, next)));
                }
            }
        }
        ways
    }
}

/// The cells around one with the length of the step, in fifths of a cell's side.
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
