//! Where a ranger can stand by the plan of a scene: in its rooms, not outside them and not in bodies.

use std::collections::{BTreeMap, HashMap};

use rstar::{
    AABB, RTree,
    primitives::{GeomWithData, Rectangle},
};

use super::{FloorPlan, Scene};
use crate::geometry::{Arrangement, DVec2, distance_to_segment, enclosed_area, encloses};

/// This far beside a wall is in the face of the plan there, metres.
const BESIDE_M: f64 = 1e-6;

/// An empty outline that stands by itself is a body if it is smaller than this share of the largest room.
const BODY_SHARE: f64 = 0.25;

/// Areas that agree to this are equal.
const SAME_AREA: f64 = 1e-6;

/// Walls by whose ids an outline is called, at most.
const MOST_NAMED: usize = 8;

/// What the closed outlines of a scene's plan are.
#[derive(Debug, Default)]
pub(super) struct Outlines {
    plan: FloorPlan,
    /// Round everything that hangs together.
    around: Rings,
    rings: Rings,
    /// By ring, whether it is a body that sound does not enter; else a room.
    is_body: Vec<bool>,
    /// Lower left and upper right corner of all rooms, metres, if there are any.
    pub(super) room: Option<[[f64; 2]; 2]>,
    /// Whether there is something to measure outside of the rooms too.
    outside_counts: bool,
}

impl Outlines {
    /// Finds them. Neither the order of walls nor their directions matter.
    ///
    /// A closed polyline is a ring, and so are walls that meet at their ends and close. A ring that a larger one
    /// overlaps is a body: a box in a room, or through its wall. One that nothing larger overlaps is a room, but
    /// for empty ones: these are bodies where the scene names poses and none is in any room, and, away from the
    /// others, where they are much smaller than the largest.
    pub(super) fn of(scene: &Scene) -> Self {
        let plan = scene.floor_plan();
        let rings = Rings::new(rings(scene, &plan.arrangement));
        let round = plan.arrangement.outlines().into_iter();
        let around =
            Rings::new(round.map(|walk| Ring::new(Vec::new(), &walk, &plan.arrangement)).collect());
        let faces = Faces::of(&plan, &rings);
        let is_body = faces.bodies(scene, &plan, &rings);
        let mut outlines = Self { plan, around, rings, is_body, room: None, outside_counts: false };
        outlines.room = outlines.rooms().map(|ring| ring.extent).reduce(|[low, high], [l, h]| {
            [[low[0].min(l[0]), low[1].min(l[1])], [high[0].max(h[0]), high[1].max(h[1])]]
        });
        outlines.outside_counts = outlines.room.is_none() || outlines.stands_outside(scene);
        outlines
    }

    /// The plan.
    pub(super) const fn plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// Whether a point is outside the rooms, where there are rooms and nothing else.
    pub(super) fn is_outside(&self, point: DVec2) -> bool {
        !self.outside_counts && !self.around.hold(point)
    }

    /// Name of a body of walls that a point is in: the smallest.
    pub(super) fn body_around(&self, scene: &Scene, point: DVec2) -> Option<String> {
        let here = self.rings.around(point).filter(|&ring| self.is_body[ring]);
        let ring =
            here.min_by(|&a, &b| self.rings.all[a].area.total_cmp(&self.rings.all[b].area))?;
        Some(self.rings.all[ring].name(scene))
    }

    fn rooms(&self) -> impl Iterator<Item = &Ring> {
        self.rings
            .all
            .iter()
            .zip(&self.is_body)
            .filter(|(_, is_body)| !**is_body)
            .map(|(ring, _)| ring)
    }

    /// Whether something stands by itself outside of the rooms.
    fn stands_outside(&self, scene: &Scene) -> bool {
        let is_in_room = |point: DVec2| {
            let mut here = self.rings.around(point);
            here.any(|ring| !self.is_body[ring])
        };
        // A part of the plan belongs to a room if any of it is in the room or on its walls.
        let touches_room = |part: &Ring| {
            part.corners
                .iter()
                .any(|&corner| is_in_room(corner) || self.rooms().any(|room| room.touches(corner)))
        };
        let walls = self.around.all.iter().any(|part| !touches_room(part));
        walls || scene.cylinders.iter().any(|cylinder| !self.around.hold(cylinder.center))
    }
}

/// A closed line of walls.
#[derive(Debug, Clone)]
struct Ring {
    /// Indices into `scene.walls`, in rising order.
    walls: Vec<u32>,
    corners: Vec<DVec2>,
    area: f64,
    /// Lower left and upper right corner of the box around it.
    extent: [[f64; 2]; 2],
}

impl Ring {
    fn new(mut walls: Vec<u32>, points: &[u32], plan: &Arrangement) -> Self {
        walls.sort_unstable();
        let corners: Vec<DVec2> = points.iter().map(|&point| plan.points[point as usize]).collect();
        let start = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) =
            corners.iter().fold(start, |(low, high), &corner| (low.min(corner), high.max(corner)));
        let extent = [low.to_array(), high.to_array()];
        Self { walls, area: enclosed_area(&corners), corners, extent }
    }

    fn touches(&self, point: DVec2) -> bool {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).any(|(&a, &b)| distance_to_segment(point, a, b) < BESIDE_M)
    }

    /// The polyline's id if it is one, else the ids of all its walls.
    fn name(&self, scene: &Scene) -> String {
        let ids: Vec<&str> =
            self.walls.iter().map(|&wall| &*scene.walls[wall as usize].id).collect();
        match number_in_polyline(ids[0]) {
            Some((stem, _))
                if ids.iter().all(|id| number_in_polyline(id).is_some_and(|of| of.0 == stem)) =>
            {
                stem.to_owned()
            }
            _ if ids.len() > MOST_NAMED => {
                let first = ids[..MOST_NAMED].join(", ");
                format!("{first} and {} more", ids.len() - MOST_NAMED)
            }
            _ => ids.join(", "),
        }
    }
}

/// The polyline that a wall belongs to by its id, and its number there.
fn number_in_polyline(id: &str) -> Option<(&str, u32)> {
    let (stem, number) = id.rsplit_once('.')?;
    Some((stem, number.parse().ok()?))
}

/// Rings, found by place.
#[derive(Debug, Default)]
struct Rings {
    all: Vec<Ring>,
    boxes: RTree<GeomWithData<Rectangle<[f64; 2]>, usize>>,
}

impl Rings {
    fn new(all: Vec<Ring>) -> Self {
        let around = |(index, ring): (usize, &Ring)| {
            let [low, high] = ring.extent;
            GeomWithData::new(Rectangle::from_corners(low, high), index)
        };
        let boxes = RTree::bulk_load(all.iter().enumerate().map(around).collect());
        Self { all, boxes }
    }

    /// Those that a point is in.
    fn around(&self, point: DVec2) -> impl Iterator<Item = usize> {
        let near = self.boxes.locate_in_envelope_intersecting(AABB::from_point(point.to_array()));
        near.map(|near| near.data).filter(move |&ring| encloses(&self.all[ring].corners, point))
    }

    fn hold(&self, point: DVec2) -> bool {
        self.around(point).next().is_some()
    }
}

/// All rings of walls: closed polylines, and of the other walls what closes by their ends.
fn rings(scene: &Scene, plan: &Arrangement) -> Vec<Ring> {
    let mut polylines: BTreeMap<&str, Vec<(u32, u32)>> = BTreeMap::new();
    for (wall, index) in scene.walls.iter().zip(0..) {
        if let Some((stem, number)) = number_in_polyline(&wall.id) {
            polylines.entry(stem).or_default().push((number, index));
        }
    }
    let mut is_free = vec![true; scene.walls.len()];
    let mut rings = Vec::new();
    for walls in polylines.values_mut() {
        walls.sort_unstable();
        let walls: Vec<u32> = walls.iter().map(|&(_, wall)| wall).collect();
        let ends: Vec<[u32; 2]> = walls.iter().map(|&wall| plan.ends[wall as usize]).collect();
        let mut after = ends.iter().cycle().skip(1);
        let closes = ends.iter().all(|end| after.next().is_some_and(|next| end[1] == next[0]));
        if closes && walls.len() >= 3 {
            walls.iter().for_each(|&wall| is_free[wall as usize] = false);
            let points: Vec<u32> = ends.iter().map(|end| end[0]).collect();
            rings.push(Ring::new(walls, &points, plan));
        }
    }
    rings.extend(joined(plan, is_free));
    rings
}

/// What walls enclose that meet at their ends, leaving out those that end nowhere.
fn joined(plan: &Arrangement, mut is_free: Vec<bool>) -> Vec<Ring> {
    let mut at: HashMap<u32, Vec<u32>> = HashMap::new();
    for (ends, wall) in plan.ends.iter().zip(0_u32..).filter(|(ends, _)| ends[0] != ends[1]) {
        if is_free[wall as usize] {
            ends.iter().for_each(|&end| at.entry(end).or_default().push(wall));
        }
    }
    let mut loose: Vec<u32> =
        at.iter().filter(|(_, walls)| walls.len() == 1).map(|(&point, _)| point).collect();
    while let Some(point) = loose.pop() {
        let Some(wall) = at.get_mut(&point).and_then(Vec::pop) else { continue };
        is_free[wall as usize] = false;
        for end in plan.ends[wall as usize] {
            if let Some(walls) = at.get_mut(&end) {
                walls.retain(|&other| other != wall);
                if walls.len() == 1 {
                    loose.push(end);
                }
            }
        }
    }
    // What is left closes; each group by itself, as others may cross it.
    let mut rings = Vec::new();
    for first in 0..plan.ends.len() as u32 {
        let mut walls = Vec::new();
        let mut ahead = vec![first];
        while let Some(wall) = ahead.pop() {
            if std::mem::take(&mut is_free[wall as usize]) {
                walls.push(wall);
                let next = plan.ends[wall as usize].iter().filter_map(|end| at.get(end));
                ahead.extend(next.flatten());
            }
        }
        if walls.len() >= 3 {
            rings.extend(ring_around(plan, walls));
        }
    }
    rings
}

fn ring_around(plan: &Arrangement, walls: Vec<u32>) -> Option<Ring> {
    let at = |point: u32| plan.points[point as usize];
    let segments: Vec<_> =
        walls.iter().map(|&wall| plan.ends[wall as usize].map(at)).map(|[a, b]| (a, b)).collect();
    let own = Arrangement::of(&segments);
    let outline = own.outlines().into_iter().next()?;
    let ring = Ring::new(walls, &outline, &own);
    (ring.area > 0.0).then_some(ring)
}

/// The faces of a plan, by a point of each.
struct Faces {
    /// For each point the rings that it is in, where there are any.
    rings: Vec<Vec<usize>>,
}

impl Faces {
    /// By points on both sides of each piece: every face has a piece.
    fn of(plan: &FloorPlan, rings: &Rings) -> Self {
        let Arrangement { points, pieces, .. } = &plan.arrangement;
        let beside = pieces.iter().flat_map(|piece| {
            let [a, b] = piece.ends.map(|end| points[end as usize]);
            let off = BESIDE_M.min(1e-3 * a.distance(b)) * (b - a).normalize_or_zero().perp();
            [0.5 * (a + b) + off, 0.5 * (a + b) - off]
        });
        let here = beside.map(|point| rings.around(point).collect::<Vec<_>>());
        Self { rings: here.filter(|here| !here.is_empty()).collect() }
    }

    /// Which rings are bodies.
    fn bodies(&self, scene: &Scene, plan: &FloorPlan, rings: &Rings) -> Vec<bool> {
        let area = |ring: usize| rings.all[ring].area;
        let mut is_body = vec![false; rings.all.len()];
        let mut is_empty = vec![true; rings.all.len()];
        for here in &self.rings {
            let most = here.iter().map(|&ring| area(ring)).fold(0.0, f64::max);
            for &ring in here {
                is_body[ring] |= area(ring) < most * (1.0 - SAME_AREA);
                is_empty[ring] &= here.len() == 1;
            }
        }
        let mut is_met = vec![false; rings.all.len()];
        self.contents(scene, plan, rings, &mut is_empty, &mut is_met);
        let mut has_pose = vec![false; rings.all.len()];
        for pose in scene.poses.values() {
            rings.around(pose.position()).for_each(|ring| has_pose[ring] = true);
        }
        let rooms = || (0..rings.all.len()).filter(|&ring| !is_body[ring]);
        let all_outside = !scene.poses.is_empty() && !rooms().any(|ring| has_pose[ring]);
        let largest = rooms().map(area).fold(0.0, f64::max);
        let is_empty_body = |&ring: &usize| {
            let is_small = !is_met[ring] && area(ring) < BODY_SHARE * largest;
            is_empty[ring] && !has_pose[ring] && (all_outside || is_small)
        };
        let more: Vec<usize> = rooms().filter(is_empty_body).collect();
        more.into_iter().for_each(|ring| is_body[ring] = true);
        is_body
    }

    /// Which rings have something in them, and which meet walls that are not their own.
    fn contents(
        &self,
        scene: &Scene,
        plan: &FloorPlan,
        rings: &Rings,
        is_empty: &mut [bool],
        is_met: &mut [bool],
    ) {
        let mut rings_at: HashMap<u32, Vec<usize>> = HashMap::new();
        for (index, ring) in rings.all.iter().enumerate() {
            let points = ring.walls.iter().flat_map(|&wall| plan.arrangement.ends[wall as usize]);
            points.for_each(|point| rings_at.entry(point).or_default().push(index));
        }
        let is_own = |ring: usize, wall: u32| rings.all[ring].walls.binary_search(&wall).is_ok();
        for piece in &plan.arrangement.pieces {
            let [a, b] = piece.ends.map(|end| plan.arrangement.points[end as usize]);
            let inside = rings.around(0.5 * (a + b));
            inside
                .filter(|&ring| !is_own(ring, piece.segment))
                .for_each(|ring| is_empty[ring] = false);
            let at_ends = piece.ends.iter().filter_map(|end| rings_at.get(end)).flatten();
            at_ends
                .filter(|&&ring| !is_own(ring, piece.segment))
                .for_each(|&ring| is_met[ring] = true);
        }
        for cylinder in &scene.cylinders {
            rings.around(cylinder.center).for_each(|ring| is_empty[ring] = false);
        }
    }
}

/// Whether a point lies inside closed sides (even-odd rule; on a side: either answer).
pub(super) fn contains(sides: &[(DVec2, DVec2)], point: DVec2) -> bool {
    let corners: Vec<DVec2> = sides.iter().map(|&(a, _)| a).collect();
    encloses(&corners, point)
}
