//! The plan that is made of a scene's walls as they were drawn, the same for every engine.

use std::cmp::Ordering;

use super::{Scene, Wall};
use crate::geometry::{Arrangement, Cause, DVec2, Piece, between, snap};

/// Two points of a plan are one if they are closer than this, unless the scene says otherwise, metres: a
/// quarter of the wavelength at 50 kHz, and twice what a hand misses a corner by.
pub const DEFAULT_SNAP_M: f64 = 0.002;

/// Moves below this are not told, metres.
const TOLD_M: f64 = 1e-9;

/// A joint is straight if it is off the line through its neighbours by less than this, metres: rounding.
const STRAIGHT_M: f64 = 1e-9;

/// The walls of a scene as sound meets them: corners closed, overshoots cut, cut where they meet, and where
/// several lie on each other one of them. From here on who meets whom is a matter of numbers, not of distances.
#[derive(Debug, Clone, Default)]
pub struct FloorPlan {
    /// By wall of the scene, its ends, metres.
    pub walls: Vec<(DVec2, DVec2)>,
    /// Pieces of the walls and the points between them; `segment` is the index of a wall.
    ///
    /// Of walls that lie on each other the tallest has the piece; of these the one that reflects most, then
    /// the least rough one, then the longest, then the first by its id.
    pub arrangement: Arrangement,
    /// What was changed, in the order of the walls.
    pub changes: Vec<Change>,
}

/// A difference between a wall of the plan and the wall as drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// One of its ends was moved.
    Moved {
        /// Index of the wall.
        wall: u32,
        /// Whether it is its second end.
        at_b: bool,
        /// Where it was drawn, metres.
        from: DVec2,
        /// Where it is, metres.
        to: DVec2,
        /// What that makes good.
        cause: Cause,
    },
    /// It lies on another one, at least partly, and that one counts there.
    Covered {
        /// Index of the wall.
        wall: u32,
        /// Index of the other.
        by: u32,
        /// Over which length, metres.
        length_m: f64,
    },
}

impl Scene {
    /// The plan of its walls.
    #[must_use]
    pub fn floor_plan(&self) -> FloorPlan {
        FloorPlan::of(self, true)
    }

    /// The same without the corners that are made right-angled for the sake of mirror images: no ray can tell.
    #[must_use]
    pub fn ray_plan(&self) -> FloorPlan {
        FloorPlan::of(self, false)
    }
}

impl FloorPlan {
    /// Whatever is decided between two is decided by place and name, so that neither the order of the file nor
    /// the direction of walls matters.
    fn of(scene: &Scene, is_squared: bool) -> Self {
        let mut by_place: Vec<u32> = (0..scene.walls.len() as u32).collect();
        let wall = |index: u32| &scene.walls[index as usize];
        by_place.sort_by(|&a, &b| places(wall(a), wall(b)));
        let is_turned: Vec<bool> =
            scene.walls.iter().map(|wall| order(wall.b, wall.a) == Ordering::Less).collect();
        let turned = |index: u32, (a, b): (DVec2, DVec2)| {
            if is_turned[index as usize] { (b, a) } else { (a, b) }
        };
        let mut segments: Vec<_> =
            by_place.iter().map(|&at| turned(at, (wall(at).a, wall(at).b))).collect();
        let moves = snap(&mut segments, scene.snap_m, is_squared);
        let mut walls = vec![(DVec2::ZERO, DVec2::ZERO); segments.len()];
        for (&index, &segment) in by_place.iter().zip(&segments) {
            walls[index as usize] = turned(index, segment);
        }
        let drawn_end = |(segment, at_b): (u32, bool)| {
            let index = by_place[segment as usize];
            (index, at_b != is_turned[index as usize])
        };
        let told = moves.into_iter().filter(|change| change.from.distance(change.to) > TOLD_M);
        let moved = told.map(|change| {
            let (wall, at_b) = drawn_end(change.end);
            let cause = match change.cause {
                Cause::Apart(other) => Cause::Apart(drawn_end(other)),
                Cause::Short(segment) => Cause::Short(by_place[segment as usize]),
                Cause::Past(segment) => Cause::Past(by_place[segment as usize]),
                Cause::Turned => Cause::Turned,
            };
            Change::Moved { wall, at_b, from: change.from, to: change.to, cause }
        });
        let mut changes: Vec<Change> = moved.collect();
        let mut by_rank = by_place;
        by_rank.sort_by(|&a, &b| ranks(wall(a), wall(b)));
        let ranked: Vec<_> =
            by_rank.iter().map(|&index| turned(index, walls[index as usize])).collect();
        let arrangement =
            as_drawn(Arrangement::of(&ranked), &by_rank, |wall| is_turned[wall as usize]);
        changes.extend(covered(scene, &arrangement));
        changes.sort_by_key(Change::key);
        Self { walls, arrangement, changes }
    }

    /// The scene with its walls as they are in the plan.
    #[must_use]
    pub fn scene(&self, scene: &Scene) -> Scene {
        let mut planned = scene.clone();
        for (wall, &(a, b)) in planned.walls.iter_mut().zip(&self.walls) {
            (wall.a, wall.b) = (a, b);
        }
        planned
    }

    /// What of each wall counts, by wall: from where to where it is not covered by another, metres.
    #[must_use]
    pub fn stretches(&self) -> Vec<(u32, (DVec2, DVec2))> {
        let mut pieces = self.arrangement.pieces.clone();
        let at = |point: u32| self.arrangement.points[point as usize];
        let along = |piece: &Piece| {
            let (a, b) = self.walls[piece.segment as usize];
            (at(piece.ends[0]) - a).dot(b - a)
        };
        pieces.sort_by(|p, q| p.segment.cmp(&q.segment).then(along(p).total_cmp(&along(q))));
        let goes_on = |p: &Piece, q: &Piece| p.segment == q.segment && p.ends[1] == q.ends[0];
        let whole = |stretch: &[Piece]| {
            let (wall, ends) =
                (stretch[0].segment, [stretch[0].ends[0], stretch[stretch.len() - 1].ends[1]]);
            let (a, b) = self.walls[wall as usize];
            let [from, to] = self.arrangement.ends[wall as usize];
            let first = if ends[0] == from { a } else { at(ends[0]) };
            let last = if ends[1] == to { b } else { at(ends[1]) };
            (wall, (first, last))
        };
        pieces.chunk_by(goes_on).map(whole).collect()
    }

    /// By point, whether nothing happens there: a wall goes straight on, as itself or another of its material.
    #[must_use]
    pub fn straight_joints(&self, scene: &Scene) -> Vec<bool> {
        let mut around: Vec<Vec<(u32, u32)>> = vec![Vec::new(); self.arrangement.points.len()];
        for Piece { ends: [a, b], segment } in &self.arrangement.pieces {
            around[*a as usize].push((*b, *segment));
            around[*b as usize].push((*a, *segment));
        }
        let at = |point: u32| self.arrangement.points[point as usize];
        let goes_on = |(pieces, point): (&Vec<(u32, u32)>, u32)| {
            let [(from, one), (to, other)] = pieces[..] else { return false };
            let [one, other] = [one, other].map(|wall| &scene.walls[wall as usize]);
            let (before, after) = (at(point) - at(from), at(to) - at(point));
            let off_m = before.perp_dot(after).abs() / (at(to) - at(from)).length();
            one.material == other.material
                && one.z_m == other.z_m
                && before.dot(after) > 0.0
                && off_m < STRAIGHT_M
        };
        around.iter().zip(0..).map(goes_on).collect()
    }

    /// The arrangement of those walls that are there.
    #[must_use]
    pub fn of_walls(&self, is_there: impl Fn(u32) -> bool) -> Arrangement {
        let mut kept = self.arrangement.clone();
        kept.covered.clear();
        kept.pieces = self
            .arrangement
            .pieces
            .iter()
            .filter_map(|piece| {
                let ends = between(piece.ends);
                let covered = self.arrangement.covered.get(&ends).into_iter().flatten();
                let mut here = [piece.segment].into_iter().chain(covered.copied());
                let segment = here.by_ref().find(|&wall| is_there(wall))?;
                let others: Vec<u32> = here.filter(|&wall| is_there(wall)).collect();
                if !others.is_empty() {
                    kept.covered.insert(ends, others);
                }
                Some(Piece { segment, ..*piece })
            })
            .collect();
        kept
    }
}

impl Change {
    /// What was changed, where and by how much, in words.
    #[must_use]
    pub fn describe(&self, scene: &Scene) -> String {
        let id = |wall: u32| &scene.walls[wall as usize].id;
        match *self {
            Self::Moved { wall, at_b, from, to, cause } => {
                let moved = format!("moved by {} mm", millimetres(from.distance(to)));
                let why = match cause {
                    Cause::Apart((other, at_b)) => {
                        let drawn = &scene.walls[other as usize];
                        let apart_m = from.distance(if at_b { drawn.b } else { drawn.a });
                        let name = format!("{}.{}", id(other), end_name(at_b));
                        format!("it was {} mm from {name}", millimetres(apart_m))
                    }
                    Cause::Short(other) => format!("it stopped short of {}", id(other)),
                    Cause::Past(other) => format!("it ran past {}", id(other)),
                    Cause::Turned => "a corner was nearly right-angled".to_owned(),
                };
                let end = format!("{}.{}", id(wall), end_name(at_b));
                format!("{end} at ({:.4}, {:.4}): {moved}, {why}", from.x, from.y)
            }
            Self::Covered { wall, by, length_m } => {
                let (one, other) = (id(wall), id(by));
                format!("{one} lies on {other} for {length_m:.3} m: {other} counts there")
            }
        }
    }

    /// The wall that it is about.
    #[must_use]
    pub const fn wall(&self) -> u32 {
        match self {
            Self::Moved { wall, .. } | Self::Covered { wall, .. } => *wall,
        }
    }

    fn key(&self) -> (u32, bool, u32) {
        match self {
            Self::Moved { wall, at_b, .. } => (*wall, *at_b, 0),
            Self::Covered { wall, by, .. } => (*wall, true, by + 1),
        }
    }
}

const fn end_name(at_b: bool) -> &'static str {
    if at_b { "b" } else { "a" }
}

/// Metres as millimetres: to the micrometre, and what is less to the picometre.
fn millimetres(length_m: f64) -> String {
    let decimals = if length_m < 1e-6 { 9 } else { 3 };
    format!("{:.decimals$}", 1e3 * length_m)
}

/// An arrangement of walls in another order and partly turned round, by the walls as they were drawn.
fn as_drawn(
    mut arrangement: Arrangement,
    order: &[u32],
    is_turned: impl Fn(u32) -> bool,
) -> Arrangement {
    let swapped = |wall: u32, [a, b]: [u32; 2]| if is_turned(wall) { [b, a] } else { [a, b] };
    for piece in &mut arrangement.pieces {
        piece.segment = order[piece.segment as usize];
        piece.ends = swapped(piece.segment, piece.ends);
    }
    for covered in arrangement.covered.values_mut().flatten() {
        *covered = order[*covered as usize];
    }
    let ends = std::mem::take(&mut arrangement.ends);
    arrangement.ends = vec![[u32::MAX; 2]; ends.len()];
    for (&wall, ends) in order.iter().zip(ends) {
        arrangement.ends[wall as usize] = swapped(wall, ends);
    }
    arrangement
}

/// Walls that share heights with one they lie on.
fn covered(scene: &Scene, arrangement: &Arrangement) -> Vec<Change> {
    let mut found: std::collections::BTreeMap<(u32, u32), f64> = std::collections::BTreeMap::new();
    for piece in &arrangement.pieces {
        let here = arrangement.covered.get(&between(piece.ends)).into_iter().flatten();
        let [a, b] = piece.ends.map(|end| arrangement.points[end as usize]);
        for &wall in here {
            if share_heights(&scene.walls[wall as usize], &scene.walls[piece.segment as usize]) {
                *found.entry((wall, piece.segment)).or_default() += a.distance(b);
            }
        }
    }
    found.into_iter().map(|((wall, by), length_m)| Change::Covered { wall, by, length_m }).collect()
}

fn share_heights(one: &Wall, other: &Wall) -> bool {
    match (one.z_m, other.z_m) {
        (Some([a, b]), Some([c, d])) => a < d && c < b,
        _ => true,
    }
}

fn order(a: DVec2, b: DVec2) -> Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
}

/// Walls by where they are, then by their names.
fn places(one: &Wall, other: &Wall) -> Ordering {
    let ends = |wall: &Wall| match order(wall.a, wall.b) {
        Ordering::Greater => [wall.b, wall.a],
        _ => [wall.a, wall.b],
    };
    let ([a, b], [c, d]) = (ends(one), ends(other));
    order(a, c).then(order(b, d)).then_with(|| one.id.cmp(&other.id))
}

/// Which of walls on each other counts: the lesser.
fn ranks(one: &Wall, other: &Wall) -> Ordering {
    let height_m = |wall: &Wall| wall.z_m.map_or(f64::INFINITY, |[from, to]| to - from);
    height_m(other)
        .total_cmp(&height_m(one))
        .then(other.material.reflectance.total_cmp(&one.material.reflectance))
        .then(one.material.roughness.total_cmp(&other.material.roughness))
        .then(other.a.distance(other.b).total_cmp(&one.a.distance(one.b)))
        .then_with(|| one.id.cmp(&other.id))
        .then_with(|| places(one, other))
}
