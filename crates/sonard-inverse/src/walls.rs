//! Changes of walls: displacements along their normals, rotations, and displacements of their ends.

use sonard_model::{
    geometry::{DVec2, distance_to_segment},
    scene::{Scene, Wall},
};

use crate::parameter::EndOfWall;

/// Maximum distance of ends that are joined, metres.
const JOINED_M: f64 = 1e-6;

/// Minimum sine of the angle between walls whose lines determine their corner.
const MIN_SINE: f64 = 0.05;

/// Half step of the velocities of ends, metres or radians.
const BY: f64 = 1e-4;

/// Change of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct WallChange {
    /// Displacement along the normal, metres.
    pub(crate) offset_m: f64,
    /// Rotation about the middle, counter-clockwise, radians.
    pub(crate) turn_rad: f64,
    /// Displacements of the ends along the wall, outwards, metres.
    pub(crate) longer_m: [f64; 2],
}

/// Unit normal of a wall: to the left from its end `a` to its end `b`.
pub(crate) fn normal(wall: &Wall) -> DVec2 {
    (wall.b - wall.a).normalize_or_zero().perp()
}

/// Ends of all walls after changes of some, metres. A wall stays on its line: where a changed one is
/// joined to it, it is extended or shortened. Where an end is moved along its wall, the walls joined
/// to it turn about their other ends.
pub(crate) fn moved_ends(scene: &Scene, changes: &[(usize, WallChange)]) -> Vec<[DVec2; 2]> {
    let changed = ChangedWalls { scene, changes };
    let ends = |at: usize| [false, true].map(|at_b| changed.end(at, at_b));
    (0..scene.walls.len()).map(ends).collect()
}

/// Ends of walls that touch no other wall.
pub(crate) fn free_ends(scene: &Scene) -> Vec<(usize, EndOfWall)> {
    let is_free = |at: usize, point: DVec2| {
        let mut others = scene.walls.iter().enumerate().filter(|(other, _)| *other != at);
        others.all(|(_, other)| distance_to_segment(point, other.a, other.b) > JOINED_M)
    };
    let of = |(at, wall): (usize, &Wall)| {
        let ends = [(EndOfWall::A, wall.a), (EndOfWall::B, wall.b)];
        ends.into_iter()
            .filter(|(_, point)| is_free(at, *point))
            .map(|(end, _)| (at, end))
            .collect()
    };
    scene.walls.iter().enumerate().flat_map::<Vec<_>, _>(of).collect()
}

/// Walls of a scene with their changes.
struct ChangedWalls<'a> {
    scene: &'a Scene,
    changes: &'a [(usize, WallChange)],
}

impl ChangedWalls<'_> {
    fn of(&self, wall: usize) -> WallChange {
        let change = self.changes.iter().find(|(at, _)| *at == wall);
        change.map_or_else(WallChange::default, |(_, change)| *change)
    }

    /// Position of an end of a wall.
    fn end(&self, at: usize, at_b: bool) -> DVec2 {
        let wall = &self.scene.walls[at];
        let point = if at_b { wall.b } else { wall.a };
        let is_joined =
            |other: &Wall| other.a.distance(point) < JOINED_M || other.b.distance(point) < JOINED_M;
        let joined = || {
            self.scene
                .walls
                .iter()
                .enumerate()
                .filter(|(other, wall)| *other != at && is_joined(wall))
        };
        // Of several joined walls, the one most perpendicular.
        let partner = joined()
            .map(|(other, joined)| (other, normal(wall).perp_dot(normal(joined)).abs()))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let own = self.carried(at, point);
        let corner = match partner {
            Some((other, sine)) if sine > MIN_SINE => {
                let joined = self.carried(other, point);
                let [n, m] = [at, other].map(|wall| self.normal(wall));
                // n . (x - own) = 0, m . (x - joined) = 0.
                let [a, b] = [n.dot(own - point), m.dot(joined - point)];
                point + DVec2::new(a * m.y - b * n.y, b * n.x - a * m.x) / n.perp_dot(m)
            }
            Some((other, _)) if self.is_fixed(at) => self.carried(other, point),
            _ => own,
        };
        let walls = joined().map(|(other, _)| other).chain([at]);
        corner + walls.map(|wall| self.along(wall, point)).sum::<DVec2>()
    }

    /// Position of a point that moves with a wall as a rigid body.
    fn carried(&self, wall: usize, point: DVec2) -> DVec2 {
        let WallChange { offset_m, turn_rad, .. } = self.of(wall);
        let moved = point + offset_m * self.normal(wall);
        if turn_rad == 0.0 {
            return moved;
        }
        let middle = 0.5 * (self.scene.walls[wall].a + self.scene.walls[wall].b);
        moved + DVec2::from_angle(turn_rad).rotate(point - middle) - (point - middle)
    }

    /// Normal of a wall after its rotation.
    fn normal(&self, wall: usize) -> DVec2 {
        let normal = normal(&self.scene.walls[wall]);
        match self.of(wall).turn_rad {
            0.0 => normal,
            turn_rad => DVec2::from_angle(turn_rad).rotate(normal),
        }
    }

    /// Returns `true` if a wall stays on its line.
    fn is_fixed(&self, wall: usize) -> bool {
        let WallChange { offset_m, turn_rad, .. } = self.of(wall);
        offset_m == 0.0 && turn_rad == 0.0
    }

    /// Displacement along a wall of its end at a point, outwards.
    fn along(&self, wall: usize, point: DVec2) -> DVec2 {
        let Wall { a, b, .. } = &self.scene.walls[wall];
        let at_b = point.distance_squared(*b) < point.distance_squared(*a);
        let [by_a, by_b] = self.of(wall).longer_m;
        // From `a` to `b`.
        let along = -self.normal(wall).perp();
        if at_b { by_b * along } else { -by_a * along }
    }
}

/// Velocities of the ends of walls for a change of one, per metre or radian of `unit`.
pub(crate) fn velocities(scene: &Scene, wall: usize, unit: &WallChange) -> Vec<(u32, [DVec2; 2])> {
    let by = |factor: f64| WallChange {
        offset_m: factor * unit.offset_m,
        turn_rad: factor * unit.turn_rad,
        longer_m: unit.longer_m.map(|longer_m| factor * longer_m),
    };
    let [before, after] = [-BY, BY].map(|factor| moved_ends(scene, &[(wall, by(factor))]));
    let rate = |(before, after): (&[DVec2; 2], &[DVec2; 2])| {
        [0, 1].map(|end| (after[end] - before[end]) / (2.0 * BY))
    };
    let rates = (0..).zip(before.iter().zip(&after).map(rate));
    rates.filter(|(_, ends)| ends.iter().any(|rate| rate.length() > 1e-9)).collect()
}
