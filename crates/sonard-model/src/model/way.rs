//! The way of an echo through the floor plan, as points.
//!
//! A path's walls and edges say what the sound met and in which order; where it met them follows
//! from mirror images, so a way can be drawn from a log's record as well as from an arrival.

use smallvec::SmallVec;

use super::{Bend, Edge, Mechanism, Path, Reflector, paths::usual_z_m};
use crate::{
    geometry::{DVec2, Mirror},
    reading::PathKind,
    scene::{Cylinder, Scene},
};

/// A way's length may differ from the one stated by this much, metres: logs round, and the engine
/// squares up corners that are written with rounded coordinates.
const SAME_LENGTH_M: f64 = 1e-3;

/// A point this far beyond the end of a wall still counts as on it, metres: corners are written with
/// rounded coordinates.
const BEYOND_END_M: f64 = 1e-4;

/// Contacts with cylinders have been found when they move by less, metres, and are given up for as
/// good as they get after so many rounds.
const CLOSE_M: f64 = 1e-7;
const MOST_ROUNDS: usize = 500;

/// A path as format 1 of the records keeps it: what it meets, without saying where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedPath {
    /// How the sound got back.
    pub kind: PathKind,
    /// Surfaces in order, the wall of a level edge among them, floor and ceiling after the others; `None`
    /// is the transducer's face.
    pub walls: SmallVec<[Option<Reflector>; 4]>,
    /// The edges it bent at, in order.
    pub bends: SmallVec<[Bend; 2]>,
}

impl From<&Path> for RecordedPath {
    fn from(path: &Path) -> Self {
        let is_met = |met: &Mechanism| !matches!(met, Mechanism::Diffraction(Bend::Upright(_)));
        let met = || path.mechanisms().filter(is_met).map(Mechanism::surface);
        let upright = |met: &Option<Reflector>| met.as_ref().is_none_or(is_upright);
        let walls = met().filter(upright).chain(met().filter(|met| !upright(met))).collect();
        Self { kind: path.kind(), walls, bends: path.bends().collect() }
    }
}

impl RecordedPath {
    /// The points of the way from a ranger at `position` and back to it, in order and in the plan: the
    /// ranger, each reflection and edge, the ranger. Round an edge the way may be the one run through
    /// backwards, which meets the same walls in the same order and arrives at the same time. `None`
    /// if there is no such way of `length_m` metres in this scene (up or down as well, in the plan it is
    /// shorter), and for what a rough wall scattered: which part of it did is not in a record.
    #[must_use]
    pub fn points(&self, scene: &Scene, position: DVec2, length_m: f64) -> Option<Vec<DVec2>> {
        self.points_between(scene, [position; 2], None, length_m)
    }

    /// The same from a transmitter to a receiver, at a height in metres if not at [`usual_z_m`].
    #[must_use]
    pub fn points_between(
        &self,
        scene: &Scene,
        [from, to]: [DVec2; 2],
        z_m: Option<f64>,
        length_m: f64,
    ) -> Option<Vec<DVec2>> {
        if self.kind == PathKind::Scattered {
            return None;
        }
        let met = || self.walls.iter().copied();
        let upright = |met: &Option<Reflector>| met.as_ref().is_none_or(is_upright);
        let rounds: SmallVec<[Option<Reflector>; 8]> = met().filter(upright).collect();
        let walls: SmallVec<[Reflector; 8]> = rounds.iter().copied().flatten().collect();
        let levels: SmallVec<[Reflector; 4]> =
            met().flatten().filter(|met| !is_upright(met)).collect();
        let z_m = z_m.unwrap_or_else(|| usual_z_m(scene.floor_z_m, scene.ceiling_z_m));
        let rise_m = level_image_m(scene, z_m, levels.iter())? - z_m;
        let plan_m = (length_m * length_m - rise_m * rise_m).max(0.0).sqrt();
        let way = Way { scene, from, to, plan_m };
        let mut edges: SmallVec<[DVec2; 2]> = SmallVec::new();
        for bend in &self.bends {
            match *bend {
                Bend::Upright(edge) => edges.push(edge.place(scene)?),
                // In a train it lies as high as the ranger, where the way in the plan is a mirror's (or
                // runs straight over it, and is not drawn).
                Bend::Level { .. } if rounds.contains(&None) => {}
                Bend::Level { wall, is_upper } => {
                    let rim_z_m = scene.walls.get(wall as usize)?.z_m?[usize::from(is_upper)];
                    return Over { way, z_m, length_m, wall, rim_z_m }.points(&walls, &levels);
                }
            }
        }
        // The transducer's face sends the sound off again from where it started.
        let rounds = rounds.split(Option::is_none);
        let rounds: Vec<SmallVec<[Reflector; 8]>> =
            rounds.map(|round| round.iter().copied().flatten().collect()).collect();
        let rounds: SmallVec<[&[Reflector]; 4]> = rounds.iter().map(|round| &round[..]).collect();
        let (first, rounds) = rounds.split_first()?;
        let mut points = vec![from];
        way.follow(&mut points, first, rounds, &edges).then_some(points)
    }
}

impl Edge {
    fn place(self, scene: &Scene) -> Option<DVec2> {
        let wall = scene.walls.get(self.wall as usize)?;
        Some(if self.at_b { wall.b } else { wall.a })
    }
}

/// The height of an image of what stands at `z_m` in floor and ceiling, one after the other; `None` if
/// the scene has no such thing.
fn level_image_m<'a>(
    scene: &Scene,
    z_m: f64,
    mut levels: impl Iterator<Item = &'a Reflector>,
) -> Option<f64> {
    levels.try_fold(z_m, |image_z_m, level| {
        let mirror_z_m =
            if *level == Reflector::Floor { scene.floor_z_m? } else { scene.ceiling_z_m? };
        Some(2.0 * mirror_z_m - image_z_m)
    })
}

/// A way that bends at a level edge.
struct Over<'a> {
    way: Way<'a>,
    /// The ranger's height and that of the edge, metres.
    z_m: f64,
    rim_z_m: f64,
    wall: u32,
    length_m: f64,
}

impl Over<'_> {
    /// Its wall stands among the others where the way bends; how many of the levels are met before that
    /// is not said, so all splits are tried.
    fn points(&self, walls: &[Reflector], levels: &[Reflector]) -> Option<Vec<DVec2>> {
        let own = walls.iter().enumerate().filter(|(_, met)| **met == Reflector::Wall(self.wall));
        let splits = own.flat_map(|(at, _)| (0..=levels.len()).map(move |split| (at, split)));
        splits.into_iter().find_map(|(at, split)| {
            let (out, back) = (&walls[..at], &walls[at + 1..]);
            let place = self.place([out, back], levels.split_at(split).into())?;
            let mut points = self.way.leg(self.way.from, place, out)?;
            points.extend(self.way.leg(place, self.way.to, back)?.into_iter().skip(1));
            Some(points)
        })
    }

    /// Where on its wall such a way bends (Keller's cone, as in `paths::rims`), if it is as long as stated.
    fn place(&self, walls: [&[Reflector]; 2], levels: [&[Reflector]; 2]) -> Option<DVec2> {
        let Way { scene, from, to, .. } = self.way;
        let takes_turns = |levels: &&[Reflector]| levels.windows(2).all(|pair| pair[0] != pair[1]);
        if !levels.iter().all(takes_turns) {
            return None;
        }
        let backwards: SmallVec<[Reflector; 8]> = walls[1].iter().rev().copied().collect();
        let images = [self.way.image(from, walls[0])?, self.way.image(to, &backwards)?];
        let heights_m = [
            level_image_m(scene, self.z_m, levels[0].iter())?,
            level_image_m(scene, self.z_m, levels[1].iter().rev())?,
        ];
        let (a, b) = self.way.wall(Reflector::Wall(self.wall))?;
        let line = Mirror::through(a, b);
        let off_m =
            [0, 1].map(|end| line.height_m(images[end]).hypot(heights_m[end] - self.rim_z_m));
        let along = (b - a).normalize_or_zero();
        let foot_m = images.map(|image| along.dot(image - a));
        let length_m = (off_m[0] + off_m[1]).hypot(foot_m[0] - foot_m[1]);
        let place_m = (foot_m[0] * off_m[1] + foot_m[1] * off_m[0]) / (off_m[0] + off_m[1]);
        let is_it = (length_m - self.length_m).abs() < SAME_LENGTH_M
            && (-BEYOND_END_M..=a.distance(b) + BEYOND_END_M).contains(&place_m);
        is_it.then(|| a + place_m * along)
    }
}

#[derive(Clone, Copy)]
struct Way<'a> {
    scene: &'a Scene,
    from: DVec2,
    to: DVec2,
    /// Its length in the plan, metres.
    plan_m: f64,
}

const fn is_upright(reflector: &Reflector) -> bool {
    !matches!(reflector, Reflector::Floor | Reflector::Ceiling)
}

impl Way<'_> {
    /// Goes on from the last of the points over the walls left of a round and the edges left, then all
    /// later rounds. Where among the walls an edge was met is not said, so all places are tried.
    /// False, with the points as they were, if there is no such way.
    fn follow(
        &self,
        points: &mut Vec<DVec2>,
        walls: &[Reflector],
        rounds: &[&[Reflector]],
        edges: &[DVec2],
    ) -> bool {
        let (known, at) = (points.len(), points.last().copied().unwrap_or(self.from));
        if let [edge, later @ ..] = edges {
            for (out, rest) in (0..=walls.len()).map(|split| walls.split_at(split)) {
                if let Some(leg) = self.leg(at, *edge, out) {
                    points.extend(leg.into_iter().skip(1));
                    if self.follow(points, rest, rounds, later) {
                        return true;
                    }
                    points.truncate(known);
                }
            }
        }
        let Some(home) = self.leg(at, self.to, walls) else { return false };
        points.extend(home.into_iter().skip(1));
        let is_whole = match rounds {
            [] => edges.is_empty() && self.has_length(points),
            [next, more @ ..] => self.follow(points, next, more, edges),
        };
        if !is_whole {
            points.truncate(known);
        }
        is_whole
    }

    /// From one point to another over these reflectors.
    fn leg(&self, from: DVec2, to: DVec2, walls: &[Reflector]) -> Option<Vec<DVec2>> {
        let contacts = self.contacts(from, to, walls)?;
        let flat = walls.split(|wall| !matches!(wall, Reflector::Wall(_)));
        let (mut points, mut at) = (vec![from], from);
        for (walls, end) in flat.zip(contacts.into_iter().chain([to])) {
            points.extend(self.flat_leg(at, end, walls)?.into_iter().skip(1));
            at = end;
        }
        Some(points)
    }

    /// Where the cylinders of a leg are met. The way is the shortest there is, and that has one
    /// place only (cylinders are convex): each contact is moved to where it is best for its
    /// neighbours, in turn, until all are.
    fn contacts(&self, from: DVec2, to: DVec2, walls: &[Reflector]) -> Option<Vec<DVec2>> {
        let round = walls.iter().filter(|wall| !matches!(wall, Reflector::Wall(_)));
        let cylinders: Vec<&Cylinder> =
            round.map(|reflector| self.cylinder(*reflector)).collect::<Option<_>>()?;
        let flat: Vec<_> = walls.split(|wall| !matches!(wall, Reflector::Wall(_))).collect();
        let backwards: Vec<SmallVec<[Reflector; 4]>> =
            flat.iter().map(|walls| walls.iter().rev().copied().collect()).collect();
        let mut contacts: Vec<DVec2> = cylinders.iter().map(|cylinder| cylinder.center).collect();
        for _ in 0..MOST_ROUNDS {
            let mut moved_m = 0.0_f64;
            for i in 0..contacts.len() {
                let before = i.checked_sub(1).map_or(from, |before| contacts[before]);
                let after = contacts.get(i + 1).copied().unwrap_or(to);
                let ends = [self.image(before, flat[i])?, self.image(after, &backwards[i + 1])?];
                let best = bounce(cylinders[i].center, cylinders[i].radius_m, ends);
                moved_m = moved_m.max(best.distance(contacts[i]));
                contacts[i] = best;
            }
            if moved_m < CLOSE_M {
                break;
            }
        }
        Some(contacts)
    }

    fn cylinder(&self, reflector: Reflector) -> Option<&Cylinder> {
        let Reflector::Cylinder(index) = reflector else { return None };
        self.scene.cylinders.get(index as usize)
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
        (length_m - self.plan_m).abs() < SAME_LENGTH_M
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
    // Through a corner the second wall is met where the first was.
    (on_wall && share * run.length() > -BEYOND_END_M).then_some(point)
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
