//! Displacement of walls along their normals.

use sonard_model::{
    geometry::DVec2,
    scene::{Scene, Wall},
};

/// Maximum distance of ends that are joined, metres.
const JOINED_M: f64 = 1e-6;

/// Unit normal of a wall: to the left from its end `a` to its end `b`.
pub(crate) fn normal(wall: &Wall) -> DVec2 {
    (wall.b - wall.a).normalize_or_zero().perp()
}

/// Ends of all walls after displacements along their normals, metres. A wall stays on its line:
/// where a displaced one is joined to it, it is extended or shortened.
pub(crate) fn moved_ends(scene: &Scene, offsets_m: &[(usize, f64)]) -> Vec<[DVec2; 2]> {
    let offset =
        |at: usize| offsets_m.iter().find(|moved| moved.0 == at).map_or(0.0, |moved| moved.1);
    let end = |at: usize, point: DVec2| {
        let wall = &scene.walls[at];
        let is_joined =
            |other: &Wall| other.a.distance(point) < JOINED_M || other.b.distance(point) < JOINED_M;
        // Of several joined walls, the one most perpendicular.
        let partner = scene
            .walls
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != at)
            .filter(|(_, other)| is_joined(other))
            .map(|(at, other)| (at, normal(wall).perp_dot(normal(other)).abs()))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let own = offset(at) * normal(wall);
        match partner {
            Some((other, sine)) if sine > 0.05 => {
                let [own, joined] = [normal(wall), normal(&scene.walls[other])];
                // own . d = own offset, joined . d = the other offset.
                let det = own.perp_dot(joined);
                let [a, b] = [offset(at), offset(other)];
                point + DVec2::new(a * joined.y - b * own.y, b * own.x - a * joined.x) / det
            }
            Some((other, _)) if offset(at) == 0.0 => {
                point + offset(other) * normal(&scene.walls[other])
            }
            _ => point + own,
        }
    };
    (0..scene.walls.len())
        .map(|at| [end(at, scene.walls[at].a), end(at, scene.walls[at].b)])
        .collect()
}

/// Velocities of the ends of walls for a unit displacement of one along its normal.
pub(crate) fn velocities(scene: &Scene, wall: usize) -> Vec<(u32, [DVec2; 2])> {
    let moved = moved_ends(scene, &[(wall, 1.0)]);
    let by = |(at, ends): (usize, &[DVec2; 2])| {
        let wall = &scene.walls[at];
        (at as u32, [ends[0] - wall.a, ends[1] - wall.b])
    };
    let rates = moved.iter().enumerate().map(by);
    rates.filter(|(_, ends)| ends.iter().any(|rate| rate.length() > 1e-9)).collect()
}
