//! Closed outlines among the walls: the room, and bodies one can't stand in.

use super::Scene;
use crate::geometry::DVec2;

/// Ends closer than this are one corner, metres.
const SAME_POINT_M: f64 = 1e-6;

/// A ring of walls, each ending where the next begins.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Outline {
    /// Indices into `scene.walls`, in order round the ring.
    pub(super) walls: Vec<usize>,
}

impl Outline {
    /// Whether a point lies inside.
    pub(super) fn contains(&self, scene: &Scene, point: DVec2) -> bool {
        contains(&self.sides(scene), point)
    }

    /// Whether a point lies inside or on a side.
    fn holds(&self, scene: &Scene, point: DVec2) -> bool {
        let sides = self.sides(scene);
        sides.iter().any(|&(a, b)| distance_to_segment(point, a, b) <= SAME_POINT_M)
            || contains(&sides, point)
    }

    fn sides(&self, scene: &Scene) -> Vec<(DVec2, DVec2)> {
        self.walls.iter().map(|&wall| (scene.walls[wall].a, scene.walls[wall].b)).collect()
    }

    /// The polyline's id if it is one, else the ids of all its walls.
    pub(super) fn name(&self, scene: &Scene) -> String {
        let ids: Vec<&str> = self.walls.iter().map(|&wall| &*scene.walls[wall].id).collect();
        let stem = |id: &str| id.rsplit_once('.').map(|(stem, _)| stem.to_owned());
        match stem(ids[0]) {
            Some(polyline) if ids.iter().all(|id| stem(id).as_ref() == Some(&polyline)) => polyline,
            _ => ids.join(", "),
        }
    }

    /// Lower left and upper right corner of the box around it.
    pub(super) fn extent(&self, scene: &Scene) -> (DVec2, DVec2) {
        self.sides(scene)
            .iter()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), (a, _)| {
                (low.min(*a), high.max(*a))
            })
    }
}

/// The closed outlines of a scene, told apart.
#[derive(Debug, Default)]
pub(super) struct Outlines {
    /// The one that holds everything else.
    pub(super) room: Option<Outline>,
    /// The others: solid bodies.
    pub(super) solids: Vec<Outline>,
}

impl Outlines {
    /// Finds them.
    ///
    /// A ring is the room if it holds all other walls and all cylinders. A ring with nothing
    /// else in the scene could be either; it is a body if named poses stand outside it only.
    pub(super) fn of(scene: &Scene) -> Self {
        let mut solids = rings(scene);
        let room = solids.iter().position(|ring| is_room(ring, scene));
        let room = room.map(|index| solids.remove(index));
        Self { room, solids }
    }
}

fn is_room(ring: &Outline, scene: &Scene) -> bool {
    let holds_all = scene
        .walls
        .iter()
        .enumerate()
        .filter(|(index, _)| !ring.walls.contains(index))
        .all(|(_, wall)| ring.holds(scene, wall.a) && ring.holds(scene, wall.b))
        && scene.cylinders.iter().all(|cylinder| ring.contains(scene, cylinder.center));
    let alone = ring.walls.len() == scene.walls.len() && scene.cylinders.is_empty();
    let stands_outside = !scene.poses.is_empty()
        && scene.poses.values().all(|pose| !ring.contains(scene, pose.position()));
    holds_all && !(alone && stands_outside)
}

/// Chains walls by shared ends into closed rings.
///
/// Walls with a free end (and, in turn, walls that hang on those only) belong to no ring. Where
/// more than two walls meet, a ring goes on with the next wall of the file, so that a closed
/// polyline is a ring of its own even if it touches another.
fn rings(scene: &Scene) -> Vec<Outline> {
    let mut free = without_loose_ends(scene);
    let mut rings = Vec::new();
    while let Some(first) = free.iter().position(|&is_free| is_free) {
        let mut walls = vec![first];
        free[first] = false;
        let start = scene.walls[first].a;
        let mut end = scene.walls[first].b;
        while !same(end, start) {
            let Some(next) = following(scene, &free, walls[walls.len() - 1], end) else { break };
            let wall = &scene.walls[next];
            end = if same(wall.a, end) { wall.b } else { wall.a };
            free[next] = false;
            walls.push(next);
        }
        if same(end, start) && walls.len() >= 3 {
            rings.push(Outline { walls });
        }
    }
    rings
}

fn following(scene: &Scene, free: &[bool], last: usize, end: DVec2) -> Option<usize> {
    let count = scene.walls.len();
    (1..count).map(|ahead| (last + ahead) % count).find(|&index| {
        free[index] && (same(scene.walls[index].a, end) || same(scene.walls[index].b, end))
    })
}

fn without_loose_ends(scene: &Scene) -> Vec<bool> {
    let mut kept = vec![true; scene.walls.len()];
    loop {
        let loose = (0..kept.len()).filter(|&index| kept[index]).find(|&index| {
            let wall = &scene.walls[index];
            [wall.a, wall.b].iter().any(|&end| {
                !(0..kept.len()).any(|other| {
                    other != index
                        && kept[other]
                        && (same(scene.walls[other].a, end) || same(scene.walls[other].b, end))
                })
            })
        });
        match loose {
            Some(index) => kept[index] = false,
            None => return kept,
        }
    }
}

fn same(a: DVec2, b: DVec2) -> bool {
    a.distance_squared(b) <= SAME_POINT_M * SAME_POINT_M
}

/// Whether a point lies inside closed sides (even-odd rule; on a side: either answer).
pub(super) fn contains(sides: &[(DVec2, DVec2)], point: DVec2) -> bool {
    let crossings = sides
        .iter()
        .filter(|(a, b)| {
            (a.y > point.y) != (b.y > point.y)
                && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
        })
        .count();
    crossings % 2 == 1
}

/// Distance of a point from the segment `a`-`b`, metres.
pub(super) fn distance_to_segment(point: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let share = (point - a).dot(along) / along.length_squared();
    point.distance(a + share.clamp(0.0, 1.0) * along)
}
