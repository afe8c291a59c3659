//! Closed outlines among the walls: the room, and bodies one can't stand in.

use std::collections::HashMap;

use super::Scene;
use crate::geometry::{DVec2, distance_to_segment};

/// Ends that agree to this are one corner, metres.
const SAME_POINT_M: f64 = 1e-6;

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

/// A ring of walls, each ending where the next begins.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Outline {
    /// Indices into `scene.walls`, in order round the ring.
    walls: Vec<usize>,
    /// Their ends, metres.
    sides: Vec<(DVec2, DVec2)>,
}

impl Outline {
    /// Whether a point lies inside.
    pub(super) fn contains(&self, point: DVec2) -> bool {
        contains(&self.sides, point)
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

    /// Lower left and upper right corner of the box around it, metres.
    pub(super) fn extent(&self) -> [[f64; 2]; 2] {
        let start = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) = self
            .sides
            .iter()
            .fold(start, |(low, high), &(a, b)| (low.min(a).min(b), high.max(a).max(b)));
        [low.to_array(), high.to_array()]
    }

    /// Whether a point lies inside or on a side.
    fn holds(&self, point: DVec2) -> bool {
        self.contains(point)
            || self.sides.iter().any(|&(a, b)| distance_to_segment(point, a, b) <= SAME_POINT_M)
    }
}

fn is_room(ring: &Outline, scene: &Scene) -> bool {
    let mut own = vec![false; scene.walls.len()];
    ring.walls.iter().for_each(|&wall| own[wall] = true);
    let mut others = scene.walls.iter().zip(&own).filter(|(_, own)| !**own);
    let holds_all = others.all(|(wall, _)| ring.holds(wall.a) && ring.holds(wall.b))
        && scene.cylinders.iter().all(|cylinder| ring.contains(cylinder.center));
    let alone = ring.walls.len() == scene.walls.len() && scene.cylinders.is_empty();
    let stands_outside =
        !scene.poses.is_empty() && scene.poses.values().all(|pose| !ring.contains(pose.position()));
    holds_all && !(alone && stands_outside)
}

/// Chains walls by shared ends into closed rings.
///
/// Walls with a free end (and, in turn, walls that hang on those only) belong to no ring. Where
/// more than two walls meet, a ring goes on with the next wall of the file, so that a closed
/// polyline is a ring of its own even if it touches another.
fn rings(scene: &Scene) -> Vec<Outline> {
    let corners = Corners::of(scene);
    let mut free = corners.without_loose_ends();
    let mut rings = Vec::new();
    for first in 0..free.len() {
        if !free[first] {
            continue;
        }
        free[first] = false;
        let mut walls = vec![first];
        let [start, mut end] = corners.ends[first];
        while end != start {
            let Some(next) = corners.next(&free, walls[walls.len() - 1], end) else { break };
            free[next] = false;
            walls.push(next);
            end = corners.far_end(next, end);
        }
        if end == start && walls.len() >= 3 {
            let sides = walls.iter().map(|&wall| (scene.walls[wall].a, scene.walls[wall].b));
            rings.push(Outline { sides: sides.collect(), walls });
        }
    }
    rings
}

/// A place where walls end, to the micrometre.
type Corner = [i64; 2];

/// Which walls meet where.
struct Corners {
    /// Both ends of each wall.
    ends: Vec<[Corner; 2]>,
    /// The walls at each corner.
    walls: HashMap<Corner, Vec<usize>>,
}

impl Corners {
    fn of(scene: &Scene) -> Self {
        let corner = |point: DVec2| point.to_array().map(|m| (m / SAME_POINT_M).round() as i64);
        let ends: Vec<_> =
            scene.walls.iter().map(|wall| [corner(wall.a), corner(wall.b)]).collect();
        let mut walls: HashMap<Corner, Vec<usize>> = HashMap::new();
        for (index, corners) in ends.iter().enumerate() {
            corners.iter().for_each(|corner| walls.entry(*corner).or_default().push(index));
        }
        Self { ends, walls }
    }

    /// Which walls may be part of a ring: those left when walls with a free end are taken away
    /// until there are none.
    fn without_loose_ends(&self) -> Vec<bool> {
        let mut kept = vec![true; self.ends.len()];
        let mut degree: HashMap<Corner, usize> =
            self.walls.iter().map(|(corner, walls)| (*corner, walls.len())).collect();
        let mut loose: Vec<Corner> =
            degree.iter().filter(|(_, count)| **count == 1).map(|(corner, _)| *corner).collect();
        while let Some(corner) = loose.pop() {
            let Some(&wall) = self.walls[&corner].iter().find(|wall| kept[**wall]) else {
                continue;
            };
            kept[wall] = false;
            for end in self.ends[wall] {
                let count = degree.entry(end).or_default();
                *count = count.saturating_sub(1);
                if *count == 1 {
                    loose.push(end);
                }
            }
        }
        kept
    }

    /// The wall to go on with after wall `last` at `corner`.
    fn next(&self, free: &[bool], last: usize, corner: Corner) -> Option<usize> {
        let count = self.ends.len();
        let here = self.walls[&corner].iter().copied().filter(|wall| free[*wall]);
        here.min_by_key(|wall| (wall + count - last) % count)
    }

    fn far_end(&self, wall: usize, near: Corner) -> Corner {
        let [a, b] = self.ends[wall];
        if a == near { b } else { a }
    }
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
