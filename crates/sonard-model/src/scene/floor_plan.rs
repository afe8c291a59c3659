//! Floor plan derived from the walls of a scene as drawn, shared by all engines.

use std::cmp::Ordering;

use super::{Scene, Wall};
use crate::geometry::{Arrangement, DVec2, SegmentPiece, SnapCause, edge_key, snap};

/// Default snap tolerance, metres: a quarter of the wavelength at 50 kHz, and twice the typical
/// error of a corner drawn by hand.
pub const DEFAULT_SNAP_M: f64 = 0.002;

/// Moves below this are not reported, metres.
const MIN_REPORTED_M: f64 = 1e-9;

/// Maximum offset of a straight joint from the line through its neighbours, metres: rounding error.
const STRAIGHT_M: f64 = 1e-9;

/// Walls of a scene as the model uses them: corners closed, overshoots removed, split at
/// intersections, and overlaps reduced to one wall. Topology is represented by indices, not by
/// distances.
#[derive(Debug, Clone, Default)]
pub struct FloorPlan {
    /// End points of each wall of the scene, metres.
    pub walls: Vec<(DVec2, DVec2)>,
    /// Pieces of the walls and the points between them; `segment` is the index of a wall.
    ///
    /// Of overlapping walls the tallest has the piece; among equals the one with the highest
    /// reflectance, then the lowest roughness, then the greatest length, then the first by id.
    pub arrangement: Arrangement,
    /// Differences from the walls as drawn, in the order of the walls.
    pub changes: Vec<PlanChange>,
}

/// Difference between a wall of the plan and the wall as drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum PlanChange {
    /// End that was moved.
    Moved {
        /// Index of the wall in the scene.
        wall: u32,
        /// `true` for the second end of the wall.
        at_b: bool,
        /// Position as drawn, metres.
        from: DVec2,
        /// Position in the plan, metres.
        to: DVec2,
        /// Defect that the move corrects.
        cause: SnapCause,
    },
    /// Wall covered at least partly by another, which replaces it there.
    Covered {
        /// Index of the covered wall.
        wall: u32,
        /// Index of the covering wall.
        by: u32,
        /// Length of the overlap, metres.
        length_m: f64,
    },
}

impl Scene {
    /// Floor plan of the scene's walls.
    #[must_use]
    pub fn floor_plan(&self) -> FloorPlan {
        FloorPlan::from_scene(self, true)
    }

    /// Floor plan without right-angle corrections, which matter for mirror images but not for rays.
    #[must_use]
    pub fn ray_plan(&self) -> FloorPlan {
        FloorPlan::from_scene(self, false)
    }
}

impl FloorPlan {
    /// Conflicts are resolved by position and name, so that the order of the file and the direction
    /// of walls are irrelevant.
    fn from_scene(scene: &Scene, is_squared: bool) -> Self {
        let mut by_position: Vec<u32> = (0..scene.walls.len() as u32).collect();
        let wall = |index: u32| &scene.walls[index as usize];
        by_position.sort_by(|&a, &b| compare_positions(wall(a), wall(b)));
        let is_turned: Vec<bool> =
            scene.walls.iter().map(|wall| order(wall.b, wall.a) == Ordering::Less).collect();
        let turned = |index: u32, (a, b): (DVec2, DVec2)| {
            if is_turned[index as usize] { (b, a) } else { (a, b) }
        };
        let mut segments: Vec<_> =
            by_position.iter().map(|&at| turned(at, (wall(at).a, wall(at).b))).collect();
        let moves = snap(&mut segments, scene.snap_m, is_squared);
        let mut walls = vec![(DVec2::ZERO, DVec2::ZERO); segments.len()];
        for (&index, &segment) in by_position.iter().zip(&segments) {
            walls[index as usize] = turned(index, segment);
        }
        let drawn_end = |(segment, at_b): (u32, bool)| {
            let index = by_position[segment as usize];
            (index, at_b != is_turned[index as usize])
        };
        let reported =
            moves.into_iter().filter(|change| change.from.distance(change.to) > MIN_REPORTED_M);
        let moved = reported.map(|change| {
            let (wall, at_b) = drawn_end(change.end);
            let cause = match change.cause {
                SnapCause::Apart(other) => SnapCause::Apart(drawn_end(other)),
                SnapCause::Short(segment) => SnapCause::Short(by_position[segment as usize]),
                SnapCause::Past(segment) => SnapCause::Past(by_position[segment as usize]),
                SnapCause::Turned => SnapCause::Turned,
            };
            PlanChange::Moved { wall, at_b, from: change.from, to: change.to, cause }
        });
        let mut changes: Vec<PlanChange> = moved.collect();
        let mut by_rank = by_position;
        by_rank.sort_by(|&a, &b| compare_ranks(wall(a), wall(b)));
        let ranked: Vec<_> =
            by_rank.iter().map(|&index| turned(index, walls[index as usize])).collect();
        let arrangement = as_drawn(Arrangement::from_segments(&ranked), &by_rank, |wall| {
            is_turned[wall as usize]
        });
        changes.extend(covered(scene, &arrangement));
        changes.sort_by_key(PlanChange::key);
        Self { walls, arrangement, changes }
    }

    /// Scene with its walls replaced by those of the plan.
    #[must_use]
    pub fn planned_scene(&self, scene: &Scene) -> Scene {
        let mut planned = scene.clone();
        for (wall, &(a, b)) in planned.walls.iter_mut().zip(&self.walls) {
            (wall.a, wall.b) = (a, b);
        }
        planned
    }

    /// Uncovered stretches of each wall: index of the wall and end points, metres.
    #[must_use]
    pub fn uncovered_stretches(&self) -> Vec<(u32, (DVec2, DVec2))> {
        let mut pieces = self.arrangement.pieces.clone();
        let at = |point: u32| self.arrangement.points[point as usize];
        let along = |piece: &SegmentPiece| {
            let (a, b) = self.walls[piece.segment as usize];
            (at(piece.ends[0]) - a).dot(b - a)
        };
        pieces.sort_by(|p, q| p.segment.cmp(&q.segment).then(along(p).total_cmp(&along(q))));
        let continues =
            |p: &SegmentPiece, q: &SegmentPiece| p.segment == q.segment && p.ends[1] == q.ends[0];
        let whole = |stretch: &[SegmentPiece]| {
            let (wall, ends) =
                (stretch[0].segment, [stretch[0].ends[0], stretch[stretch.len() - 1].ends[1]]);
            let (a, b) = self.walls[wall as usize];
            let [from, to] = self.arrangement.ends[wall as usize];
            let first = if ends[0] == from { a } else { at(ends[0]) };
            let last = if ends[1] == to { b } else { at(ends[1]) };
            (wall, (first, last))
        };
        pieces.chunk_by(continues).map(whole).collect()
    }

    /// Classification of points: `true` where a wall continues straight on, as itself or another
    /// wall of the same material.
    #[must_use]
    pub fn straight_joints(&self, scene: &Scene) -> Vec<bool> {
        let mut around: Vec<Vec<(u32, u32)>> = vec![Vec::new(); self.arrangement.points.len()];
        for SegmentPiece { ends: [a, b], segment } in &self.arrangement.pieces {
            around[*a as usize].push((*b, *segment));
            around[*b as usize].push((*a, *segment));
        }
        let at = |point: u32| self.arrangement.points[point as usize];
        let is_straight = |(pieces, point): (&Vec<(u32, u32)>, u32)| {
            let [(from, before), (to, after)] = pieces[..] else { return false };
            let [first, second] = [before, after].map(|wall| &scene.walls[wall as usize]);
            let (before, after) = (at(point) - at(from), at(to) - at(point));
            let off_m = before.perp_dot(after).abs() / (at(to) - at(from)).length();
            first.material == second.material
                && first.z_m == second.z_m
                && before.dot(after) > 0.0
                && off_m < STRAIGHT_M
        };
        around.iter().zip(0..).map(is_straight).collect()
    }

    /// Arrangement restricted to the walls for which `is_there` returns `true`.
    #[must_use]
    pub fn restricted_to(&self, is_there: impl Fn(u32) -> bool) -> Arrangement {
        let mut kept = self.arrangement.clone();
        kept.covered.clear();
        kept.pieces = self
            .arrangement
            .pieces
            .iter()
            .filter_map(|piece| {
                let ends = edge_key(piece.ends);
                let covered = self.arrangement.covered.get(&ends).into_iter().flatten();
                let mut here = [piece.segment].into_iter().chain(covered.copied());
                let segment = here.by_ref().find(|&wall| is_there(wall))?;
                let others: Vec<u32> = here.filter(|&wall| is_there(wall)).collect();
                if !others.is_empty() {
                    kept.covered.insert(ends, others);
                }
                Some(SegmentPiece { segment, ..*piece })
            })
            .collect();
        kept
    }
}

impl PlanChange {
    /// Description of the change, with position and size.
    #[must_use]
    pub fn describe(&self, scene: &Scene) -> String {
        let id = |wall: u32| &scene.walls[wall as usize].id;
        match *self {
            Self::Moved { wall, at_b, from, to, cause } => {
                let moved = format!("moved by {} mm", millimetres(from.distance(to)));
                let why = match cause {
                    SnapCause::Apart((other, at_b)) => {
                        let drawn = &scene.walls[other as usize];
                        let apart_m = from.distance(if at_b { drawn.b } else { drawn.a });
                        let name = format!("{}.{}", id(other), end_name(at_b));
                        format!("{} mm from {name}", millimetres(apart_m))
                    }
                    SnapCause::Short(other) => format!("short of {}", id(other)),
                    SnapCause::Past(other) => format!("past {}", id(other)),
                    SnapCause::Turned => "corner nearly right-angled".to_owned(),
                };
                let end = format!("{}.{}", id(wall), end_name(at_b));
                format!("{end} at ({:.4}, {:.4}): {moved}, {why}", from.x, from.y)
            }
            Self::Covered { wall, by, length_m } => {
                format!("{0} overlaps {1} over {length_m:.3} m: {1} is used", id(wall), id(by))
            }
        }
    }

    /// Index of the changed wall.
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

/// Length in millimetres: three decimals, or nine below one micrometre.
fn millimetres(length_m: f64) -> String {
    let decimals = if length_m < 1e-6 { 9 } else { 3 };
    format!("{:.decimals$}", 1e3 * length_m)
}

/// Maps an arrangement of reordered and partly reversed walls back to the walls as drawn.
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

/// Walls that overlap another one within common heights.
fn covered(scene: &Scene, arrangement: &Arrangement) -> Vec<PlanChange> {
    let mut found: std::collections::BTreeMap<(u32, u32), f64> = std::collections::BTreeMap::new();
    for piece in &arrangement.pieces {
        let here = arrangement.covered.get(&edge_key(piece.ends)).into_iter().flatten();
        let [a, b] = piece.ends.map(|end| arrangement.points[end as usize]);
        for &wall in here {
            if share_heights(&scene.walls[wall as usize], &scene.walls[piece.segment as usize]) {
                *found.entry((wall, piece.segment)).or_default() += a.distance(b);
            }
        }
    }
    found
        .into_iter()
        .map(|((wall, by), length_m)| PlanChange::Covered { wall, by, length_m })
        .collect()
}

fn share_heights(a: &Wall, b: &Wall) -> bool {
    match (a.z_m, b.z_m) {
        (Some([a_low, a_high]), Some([b_low, b_high])) => a_low < b_high && b_low < a_high,
        _ => true,
    }
}

fn order(a: DVec2, b: DVec2) -> Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
}

/// Order of walls by position, then by name.
fn compare_positions(first: &Wall, second: &Wall) -> Ordering {
    let ends = |wall: &Wall| match order(wall.a, wall.b) {
        Ordering::Greater => [wall.b, wall.a],
        _ => [wall.a, wall.b],
    };
    let ([a, b], [c, d]) = (ends(first), ends(second));
    order(a, c).then(order(b, d)).then_with(|| first.id.cmp(&second.id))
}

/// Precedence of overlapping walls: the lesser is kept.
fn compare_ranks(a: &Wall, b: &Wall) -> Ordering {
    let height_m = |wall: &Wall| wall.z_m.map_or(f64::INFINITY, |[from, to]| to - from);
    height_m(b)
        .total_cmp(&height_m(a))
        .then(b.material.reflectance.total_cmp(&a.material.reflectance))
        .then(a.material.roughness.total_cmp(&b.material.roughness))
        .then(b.a.distance(b.b).total_cmp(&a.a.distance(a.b)))
        .then_with(|| a.id.cmp(&b.id))
        .then_with(|| compare_positions(a, b))
}
