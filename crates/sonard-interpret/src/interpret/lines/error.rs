//! Error measures of a line map against the true walls.

use serde::Serialize;

use super::MapLine;
use sonard_model::{
    geometry::{DVec2, distance_to_segment},
    scene::Scene,
};

/// Cap on every distance, metres: a missing wall counts the same in a large room as in a small
/// one.
pub const MAX_ERROR_M: f64 = 0.5;

/// Sampling distance along lines, metres.
const SAMPLE_M: f64 = 0.02;

/// Errors of a line map, metres. Each distance is capped at [`MAX_ERROR_M`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MapError {
    /// Mean of the line and the endpoint error.
    pub map_error_m: f64,
    /// Mean of `false_m` and `missing_m`.
    pub line_error_m: f64,
    /// Mean of `false_end_m` and `missing_end_m`.
    pub endpoint_error_m: f64,
    /// Mean distance of the map's lines from walls, over their length.
    pub false_m: f64,
    /// Mean distance of the walls from the map's lines, over their length.
    pub missing_m: f64,
    /// Mean distance of the ends of the map's lines from ends of walls.
    pub false_end_m: f64,
    /// Mean distance of the ends of walls from ends of the map's lines.
    pub missing_end_m: f64,
}

/// Compares a line map with all walls of a scene. Cylinders count as obstacles near a line, but
/// have no ends and can't be missing.
#[must_use]
pub fn map_error(lines: &[MapLine], scene: &Scene) -> MapError {
    let of_lines: Vec<[DVec2; 2]> = lines.iter().map(|line| line.ends).collect();
    let of_walls: Vec<[DVec2; 2]> = scene.walls.iter().map(|wall| [wall.a, wall.b]).collect();
    let to_lines = |point: DVec2| nearest(&of_lines, |[a, b]| distance_to_segment(point, *a, *b));
    let to_ends = |ends: &[[DVec2; 2]], point: DVec2| {
        nearest(ends, |[a, b]| point.distance(*a).min(point.distance(*b)))
    };
    let false_m = mean_along(&of_lines, |point| scene.clearance_m(point));
    let missing_m = mean_along(&of_walls, to_lines);
    let mean_of_ends = |ends: &[[DVec2; 2]], others: &[[DVec2; 2]]| {
        mean(ends.iter().flatten().map(|end| (1.0, to_ends(others, *end))))
    };
    let false_end_m = mean_of_ends(&of_lines, &of_walls);
    let missing_end_m = mean_of_ends(&of_walls, &of_lines);
    let (line_error_m, endpoint_error_m) =
        (false_m.midpoint(missing_m), false_end_m.midpoint(missing_end_m));
    let map_error_m = line_error_m.midpoint(endpoint_error_m);
    MapError {
        map_error_m,
        line_error_m,
        endpoint_error_m,
        false_m,
        missing_m,
        false_end_m,
        missing_end_m,
    }
}

fn nearest(segments: &[[DVec2; 2]], distance_m: impl Fn(&[DVec2; 2]) -> f64) -> f64 {
    segments.iter().map(distance_m).fold(f64::INFINITY, f64::min)
}

/// Mean capped distance over the length of all segments.
fn mean_along(segments: &[[DVec2; 2]], distance_m: impl Fn(DVec2) -> f64) -> f64 {
    mean(segments.iter().flat_map(|[a, b]| {
        let parts = (a.distance(*b) / SAMPLE_M).ceil().max(1.0);
        let weight = a.distance(*b) / parts;
        let distance_m = &distance_m;
        (0..parts as usize)
            .map(move |part| (weight, distance_m(a.lerp(*b, (part as f64 + 0.5) / parts))))
    }))
}

/// Weighted mean of distances capped at [`MAX_ERROR_M`]; the cap itself if there is none.
fn mean(distances: impl Iterator<Item = (f64, f64)>) -> f64 {
    let add = |(sum, whole): (f64, f64), (weight, distance_m): (f64, f64)| {
        (sum + weight * distance_m.min(MAX_ERROR_M), whole + weight)
    };
    let (sum, whole) = distances.fold((0.0, 0.0), add);
    if whole > 0.0 { sum / whole } else { MAX_ERROR_M }
}
