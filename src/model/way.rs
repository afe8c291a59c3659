//! The way of an echo through the floor plan, as points.
//!
//! A path's walls and edge say what the sound met and in which order; where it met them follows
//! from mirror images, so a way can be drawn from a log's record as well as from an arrival.

use smallvec::SmallVec;

use super::{Edge, Path, Reflector};
use crate::{
    geometry::{DVec2, Mirror},
    scan::PathRecord,
    scene::Scene,
};

/// A way's length may differ from the one stated by this much, metres: logs round, and the engine
/// squares up corners that are written with rounded coordinates.
const SAME_LENGTH_M: f64 = 1e-3;

/// A point this far beyond the end of a wall still counts as on it, metres: corners are written with
/// rounded coordinates.
const BEYOND_END_M: f64 = 1e-4;

impl Path {
    /// The points of the way from a ranger at `position` and back to it, in order: the ranger, each
    /// reflection and the edge, the ranger. Round an edge the way may be the one run through
    /// backwards, which meets the same walls in the same order and arrives at the same time. `None` if there is no such way of `length_m` metres in
    /// this scene.
    #[must_use]
    pub fn points(&self, scene: &Scene, position: DVec2, length_m: f64) -> Option<Vec<DVec2>> {
        let edge = match self.edge {
            Some(edge) => Some(edge.place(scene)?),
            None => None,
        };
        let whole = Way { scene, length_m };
        match edge {
            None => whole.there_and_back(position, &self.walls),
            // The record does not say where among the walls the edge was met.
            Some(edge) => (0..=self.walls.len())
                .find_map(|split| whole.around(position, edge, self.walls.split_at(split))),
        }
    }

    /// The path of a log's record in its scene; `None` if the scene lacks one of its names.
    #[must_use]
    pub fn from_record(record: &PathRecord, scene: &Scene) -> Option<Self> {
        let walls: Option<SmallVec<[Reflector; 4]>> =
            record.walls.iter().map(|name| reflector(scene, name)).collect();
        let edge = match &record.edge {
            Some(name) => Some(edge(scene, name)?),
            None => None,
        };
        Some(Self { kind: record.kind, walls: walls?, edge })
    }
}

impl Edge {
    fn place(self, scene: &Scene) -> Option<DVec2> {
        let wall = scene.walls.get(self.wall as usize)?;
        Some(if self.at_b { wall.b } else { wall.a })
    }
}

fn reflector(scene: &Scene, name: &str) -> Option<Reflector> {
    let wall = scene.walls.iter().position(|wall| &*wall.id == name);
    let cylinder = || scene.cylinders.iter().position(|cylinder| &*cylinder.id == name);
    wall.map(|index| Reflector::Wall(index as u32))
        .or_else(|| cylinder().map(|index| Reflector::Cylinder(index as u32)))
}

fn edge(scene: &Scene, name: &str) -> Option<Edge> {
    let (wall, end) = name.rsplit_once('.')?;
    let wall = scene.walls.iter().position(|known| &*known.id == wall)? as u32;
    match end {
        "a" => Some(Edge { wall, at_b: false }),
        "b" => Some(Edge { wall, at_b: true }),
        _ => None,
    }
}

struct Way<'a> {
    scene: &'a Scene,
    length_m: f64,
}

impl Way<'_> {
    fn there_and_back(&self, from: DVec2, walls: &[Reflector]) -> Option<Vec<DVec2>> {
        let points = self.leg(from, from, walls)?;
        self.has_length(&points).then_some(points)
    }

    fn around(
        &self,
        from: DVec2,
        edge: DVec2,
        (out, back): (&[Reflector], &[Reflector]),
    ) -> Option<Vec<DVec2>> {
        let mut points = self.leg(from, edge, out)?;
        points.extend(self.leg(edge, from, back)?.into_iter().skip(1));
        self.has_length(&points).then_some(points)
    }

    /// From one point to another over these reflectors, at most one of them a cylinder.
    fn leg(&self, from: DVec2, to: DVec2, walls: &[Reflector]) -> Option<Vec<DVec2>> {
        let round = walls.iter().position(|wall| !matches!(wall, Reflector::Wall(_)));
        let Some(round) = round else { return self.flat_leg(from, to, walls) };
        let Reflector::Cylinder(index) = walls[round] else { return None };
        let cylinder = self.scene.cylinders.get(index as usize)?;
        let (before, after) = (&walls[..round], &walls[round + 1..]);
        let backwards: SmallVec<[Reflector; 4]> = after.iter().rev().copied().collect();
        let ends = [self.image(from, before)?, self.image(to, &backwards)?];
        let bounce = bounce(cylinder.center, cylinder.radius_m, ends);
        let mut points = self.flat_leg(from, bounce, before)?;
        points.extend(self.flat_leg(bounce, to, after)?.into_iter().skip(1));
        Some(points)
    }

    fn flat_leg(&self, from: DVec2, to: DVec2, walls: &[Reflector]) -> Option<Vec<DVec2>> {
        let mut points = vec![to];
        let mut at = to;
        for (place, wall) in walls.iter().enumerate().rev() {
            let (a, b) = self.wall(*wall)?;
            // Seen from behind this wall, the sound comes straight from this image.
            let image = self.image(from, &walls[..=place])?;
            at = meet((a, b), at, image)?;
            points.push(at);
        }
        points.push(from);
        points.reverse();
        Some(points)
    }

    /// Image of a point in these walls, one after the other.
    fn image(&self, point: DVec2, walls: &[Reflector]) -> Option<DVec2> {
        walls.iter().try_fold(point, |image, wall| {
            let (a, b) = self.wall(*wall)?;
            Some(Mirror::through(a, b).image(image))
        })
    }

    fn wall(&self, reflector: Reflector) -> Option<(DVec2, DVec2)> {
        let Reflector::Wall(index) = reflector else { return None };
        self.scene.walls.get(index as usize).map(|wall| (wall.a, wall.b))
    }

    fn has_length(&self, points: &[DVec2]) -> bool {
        let length_m: f64 = points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        (length_m - self.length_m).abs() < SAME_LENGTH_M
    }
}

/// Where the line from `at` to `image` meets a wall.
fn meet((a, b): (DVec2, DVec2), at: DVec2, image: DVec2) -> Option<DVec2> {
    let (along, run) = ((b - a).normalize_or_zero(), image - at);
    let across = along.perp_dot(run);
    if across.abs() < 1e-12 {
        return None;
    }
    let share = along.perp_dot(a - at) / across;
    let point = at + share * run;
    let place_m = (point - a).dot(along);
    let on_wall = (-BEYOND_END_M..=a.distance(b) + BEYOND_END_M).contains(&place_m);
    (on_wall && share > -1e-9).then_some(point)
}

/// Where on a circle the way between two points outside it is shortest.
fn bounce(center: DVec2, radius_m: f64, ends: [DVec2; 2]) -> DVec2 {
    let [one, other] = ends.map(|end| (end - center).to_angle());
    let turn = crate::geometry::wrap_pi(other - one);
    let point = |share: f64| center + radius_m * DVec2::from_angle(one + share * turn);
    let length_m = |share: f64| point(share).distance(ends[0]) + point(share).distance(ends[1]);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let third = (high - low) / 3.0;
        if length_m(low + third) < length_m(high - third) { high -= third } else { low += third }
    }
    point((low + high) / 2.0)
}
