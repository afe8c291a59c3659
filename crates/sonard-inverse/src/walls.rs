//! Walls that stand elsewhere than drawn.

use sonard_model::{
    geometry::DVec2,
    scene::{Scene, Wall},
};

/// Ends nearer to each other than this meet, metres.
const MEET_M: f64 = 1e-6;

/// Unit normal of a wall: to the left of the way from its end `a` to its end `b`.
pub(crate) fn normal(wall: &Wall) -> DVec2 {
    (wall.b - wall.a).normalize_or_zero().perp()
}

/// The ends of all walls once some have moved along their normals by so many metres. A wall stays on its line:
/// where a moved one meets it, it is made longer or shorter.
pub(crate) fn moved_ends(scene: &Scene, offsets_m: &[(usize, f64)]) -> Vec<[DVec2; 2]> {
    let offset =
        |at: usize| offsets_m.iter().find(|moved| moved.0 == at).map_or(0.0, |moved| moved.1);
    let end = |at: usize, point: DVec2| {
        let wall = &scene.walls[at];
        let meets =
            |other: &Wall| other.a.distance(point) < MEET_M || other.b.distance(point) < MEET_M;
        // Of several walls that meet here, the one that fixes the place best.
        let partner = scene
            .walls
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != at)
            .filter(|(_, other)| meets(other))
            .map(|(at, other)| (at, normal(wall).perp_dot(normal(other)).abs()))
            .max_by(|one, other| one.1.total_cmp(&other.1));
        let own = offset(at) * normal(wall);
        match partner {
            Some((other, sine)) if sine > 0.05 => {
                let [one, two] = [normal(wall), normal(&scene.walls[other])];
                // one . d = own offset, two . d = the other's.
                let det = one.perp_dot(two);
                let [a, b] = [offset(at), offset(other)];
                point + DVec2::new(a * two.y - b * one.y, b * one.x - a * two.x) / det
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

/// What the ends of walls move for each metre that one moves along its normal.
pub(crate) fn rates(scene: &Scene, wall: usize) -> Vec<(u32, [DVec2; 2])> {
    let moved = moved_ends(scene, &[(wall, 1.0)]);
    let by = |(at, ends): (usize, &[DVec2; 2])| {
        let wall = &scene.walls[at];
        (at as u32, [ends[0] - wall.a, ends[1] - wall.b])
    };
    let rates = moved.iter().enumerate().map(by);
    rates.filter(|(_, ends)| ends.iter().any(|rate| rate.length() > 1e-9)).collect()
}
