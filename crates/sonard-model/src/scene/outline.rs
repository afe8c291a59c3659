//! Accessible area of a scene's plan: inside rooms, not outside them and not inside bodies.

use std::collections::{BTreeMap, HashMap};

use rstar::{
    AABB, RTree,
    primitives::{GeomWithData, Rectangle},
};

use super::{FloorPlan, Scene};
use crate::geometry::{Arrangement, DVec2, distance_to_segment, enclosed_area, encloses};

/// Offset of test points from a wall, metres.
const SIDE_OFFSET_M: f64 = 1e-6;

/// Maximum area of an isolated empty outline that is a body, relative to the largest room.
const BODY_SHARE: f64 = 0.25;

/// Relative tolerance for equal areas.
const SAME_AREA: f64 = 1e-6;

/// Maximum number of walls listed in the name of an outline.
const MAX_NAMED: usize = 8;

/// Closed outlines of a scene's plan, classified as rooms and bodies.
#[derive(Debug, Default)]
pub(super) struct SceneOutlines {
    plan: FloorPlan,
    /// Outer boundaries of the connected components.
    around: WallRings,
    rings: WallRings,
    /// Classification by ring: a body that sound does not enter, or else a room.
    is_body: Vec<bool>,
    /// Bounding box of all rooms, lower left and upper right corner, metres, if there are any.
    pub(super) room: Option<[[f64; 2]; 2]>,
    /// The area outside the rooms is accessible as well.
    outside_counts: bool,
}

impl SceneOutlines {
    /// Finds and classifies the outlines of a scene. The order and direction of walls are
    /// irrelevant.
    ///
    /// Closed polylines are rings, and so are walls joined at their ends to a closed loop. A ring
    /// that overlaps a larger one is a body: a box in a room, or through its wall. A ring without a
    /// larger overlapping one is a room, except for empty rings. These are bodies if the scene
    /// names poses and none is in any room. An isolated empty ring is a body if it is much smaller
    /// than the largest room.
    pub(super) fn from_scene(scene: &Scene) -> Self {
        let plan = scene.floor_plan();
        let rings = WallRings::new(rings(scene, &plan.arrangement));
        let boundaries = plan.arrangement.outlines().into_iter();
        let around = WallRings::new(
            boundaries.map(|walk| WallRing::new(Vec::new(), &walk, &plan.arrangement)).collect(),
        );
        let faces = Faces::new(&plan, &rings);
        let is_body = faces.bodies(scene, &plan, &rings);
        let mut outlines = Self { plan, around, rings, is_body, room: None, outside_counts: false };
        outlines.room = outlines.rooms().map(|ring| ring.extent).reduce(|[low, high], [l, h]| {
            [[low[0].min(l[0]), low[1].min(l[1])], [high[0].max(h[0]), high[1].max(h[1])]]
        });
        outlines.outside_counts = outlines.room.is_none() || outlines.has_objects_outside(scene);
        outlines
    }

    pub(super) const fn plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// Returns `true` if a point is outside the rooms of a scene that has rooms and nothing outside
    /// them.
    pub(super) fn is_outside(&self, point: DVec2) -> bool {
        !self.outside_counts && !self.around.contain(point)
    }

    /// Name of the smallest body of walls around a point.
    pub(super) fn body_around(&self, scene: &Scene, point: DVec2) -> Option<String> {
        let here = self.rings.around(point).filter(|&ring| self.is_body[ring]);
        let ring =
            here.min_by(|&a, &b| self.rings.all[a].area.total_cmp(&self.rings.all[b].area))?;
        Some(self.rings.all[ring].name(scene))
    }

    fn rooms(&self) -> impl Iterator<Item = &WallRing> {
        self.rings
            .all
            .iter()
            .zip(&self.is_body)
            .filter(|(_, is_body)| !**is_body)
            .map(|(ring, _)| ring)
    }

    /// Returns `true` if walls or cylinders are isolated from the rooms.
    fn has_objects_outside(&self, scene: &Scene) -> bool {
        let is_in_room = |point: DVec2| {
            let mut here = self.rings.around(point);
            here.any(|ring| !self.is_body[ring])
        };
        // A component belongs to a room if any part of it is in the room or on its walls.
        let touches_room = |part: &WallRing| {
            part.corners
                .iter()
                .any(|&corner| is_in_room(corner) || self.rooms().any(|room| room.touches(corner)))
        };
        let walls = self.around.all.iter().any(|part| !touches_room(part));
        walls || scene.cylinders.iter().any(|cylinder| !self.around.contain(cylinder.center))
    }
}

/// Closed loop of walls.
#[derive(Debug, Clone)]
struct WallRing {
    /// Indices into `scene.walls`, ascending.
    walls: Vec<u32>,
    corners: Vec<DVec2>,
    area: f64,
    /// Bounding box, lower left and upper right corner.
    extent: [[f64; 2]; 2],
}

impl WallRing {
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
        self.corners
            .iter()
            .zip(next)
            .any(|(&a, &b)| distance_to_segment(point, a, b) < SIDE_OFFSET_M)
    }

    /// Id of the polyline if the ring is one, else the ids of all its walls.
    fn name(&self, scene: &Scene) -> String {
        let ids: Vec<&str> =
            self.walls.iter().map(|&wall| &*scene.walls[wall as usize].id).collect();
        match number_in_polyline(ids[0]) {
            Some((stem, _))
                if ids
                    .iter()
                    .all(|id| number_in_polyline(id).is_some_and(|(own, _)| own == stem)) =>
            {
                stem.to_owned()
            }
            _ if ids.len() > MAX_NAMED => {
                let first = ids[..MAX_NAMED].join(", ");
                format!("{first} and {} more", ids.len() - MAX_NAMED)
            }
            _ => ids.join(", "),
        }
    }
}

/// Polyline of a wall, derived from its id, and its index in the polyline.
fn number_in_polyline(id: &str) -> Option<(&str, u32)> {
    let (stem, number) = id.rsplit_once('.')?;
    Some((stem, number.parse().ok()?))
}

/// Rings with a spatial index.
#[derive(Debug, Default)]
struct WallRings {
    all: Vec<WallRing>,
    boxes: RTree<GeomWithData<Rectangle<[f64; 2]>, usize>>,
}

impl WallRings {
    fn new(all: Vec<WallRing>) -> Self {
        let around = |(index, ring): (usize, &WallRing)| {
            let [low, high] = ring.extent;
            GeomWithData::new(Rectangle::from_corners(low, high), index)
        };
        let boxes = RTree::bulk_load(all.iter().enumerate().map(around).collect());
        Self { all, boxes }
    }

    /// Indices of the rings around a point.
    fn around(&self, point: DVec2) -> impl Iterator<Item = usize> {
        let near = self.boxes.locate_in_envelope_intersecting(AABB::from_point(point.to_array()));
        near.map(|near| near.data).filter(move |&ring| encloses(&self.all[ring].corners, point))
    }

    fn contain(&self, point: DVec2) -> bool {
        self.around(point).next().is_some()
    }
}

/// Rings of walls: closed polylines, and closed loops of the remaining walls.
fn rings(scene: &Scene, plan: &Arrangement) -> Vec<WallRing> {
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
        let is_closed = ends.iter().all(|end| after.next().is_some_and(|next| end[1] == next[0]));
        if is_closed && walls.len() >= 3 {
            walls.iter().for_each(|&wall| is_free[wall as usize] = false);
            let points: Vec<u32> = ends.iter().map(|end| end[0]).collect();
            rings.push(WallRing::new(walls, &points, plan));
        }
    }
    rings.extend(loops(plan, is_free));
    rings
}

/// Closed loops of walls joined at their ends, without dead ends.
fn loops(plan: &Arrangement, mut is_free: Vec<bool>) -> Vec<WallRing> {
    let mut at: HashMap<u32, Vec<u32>> = HashMap::new();
    for (ends, wall) in plan.ends.iter().zip(0_u32..).filter(|(ends, _)| ends[0] != ends[1]) {
        if is_free[wall as usize] {
            ends.iter().for_each(|&end| at.entry(end).or_default().push(wall));
        }
    }
    let mut dead_ends: Vec<u32> =
        at.iter().filter(|(_, walls)| walls.len() == 1).map(|(&point, _)| point).collect();
    while let Some(point) = dead_ends.pop() {
        let Some(wall) = at.get_mut(&point).and_then(Vec::pop) else { continue };
        is_free[wall as usize] = false;
        for end in plan.ends[wall as usize] {
            if let Some(walls) = at.get_mut(&end) {
                walls.retain(|&other| other != wall);
                if walls.len() == 1 {
                    dead_ends.push(end);
                }
            }
        }
    }
    // The remaining walls form loops; each group is taken separately, as others may cross it.
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

fn ring_around(plan: &Arrangement, walls: Vec<u32>) -> Option<WallRing> {
    let at = |point: u32| plan.points[point as usize];
    let segments: Vec<_> =
        walls.iter().map(|&wall| plan.ends[wall as usize].map(at)).map(|[a, b]| (a, b)).collect();
    let own = Arrangement::from_segments(&segments);
    let outline = own.outlines().into_iter().next()?;
    let ring = WallRing::new(walls, &outline, &own);
    (ring.area > 0.0).then_some(ring)
}

/// Faces of a plan, represented by the rings around a test point in each.
struct Faces {
    /// Rings around each test point, where there are any.
    rings: Vec<Vec<usize>>,
}

impl Faces {
    /// Tests points on both sides of each piece: every face is adjacent to a piece.
    fn new(plan: &FloorPlan, rings: &WallRings) -> Self {
        let Arrangement { points, pieces, .. } = &plan.arrangement;
        let test_points = pieces.iter().flat_map(|piece| {
            let [a, b] = piece.ends.map(|end| points[end as usize]);
            let off = SIDE_OFFSET_M.min(1e-3 * a.distance(b)) * (b - a).normalize_or_zero().perp();
            [0.5 * (a + b) + off, 0.5 * (a + b) - off]
        });
        let here = test_points.map(|point| rings.around(point).collect::<Vec<_>>());
        Self { rings: here.filter(|here| !here.is_empty()).collect() }
    }

    /// Classification of the rings: `true` for bodies.
    fn bodies(&self, scene: &Scene, plan: &FloorPlan, rings: &WallRings) -> Vec<bool> {
        let area = |ring: usize| rings.all[ring].area;
        let mut is_body = vec![false; rings.all.len()];
        let mut is_empty = vec![true; rings.all.len()];
        for here in &self.rings {
            let largest = here.iter().map(|&ring| area(ring)).fold(0.0, f64::max);
            for &ring in here {
                is_body[ring] |= area(ring) < largest * (1.0 - SAME_AREA);
                is_empty[ring] &= here.len() == 1;
            }
        }
        let mut has_contact = vec![false; rings.all.len()];
        self.mark_contents(scene, plan, rings, &mut is_empty, &mut has_contact);
        let mut has_pose = vec![false; rings.all.len()];
        for pose in scene.poses.values() {
            rings.around(pose.position()).for_each(|ring| has_pose[ring] = true);
        }
        let rooms = || (0..rings.all.len()).filter(|&ring| !is_body[ring]);
        let all_outside = !scene.poses.is_empty() && !rooms().any(|ring| has_pose[ring]);
        let largest = rooms().map(area).fold(0.0, f64::max);
        let is_empty_body = |&ring: &usize| {
            let is_small = !has_contact[ring] && area(ring) < BODY_SHARE * largest;
            is_empty[ring] && !has_pose[ring] && (all_outside || is_small)
        };
        let more: Vec<usize> = rooms().filter(is_empty_body).collect();
        more.into_iter().for_each(|ring| is_body[ring] = true);
        is_body
    }

    /// Clears `is_empty` for rings with contents, and sets `has_contact` for rings joined to walls
    /// of others.
    fn mark_contents(
        &self,
        scene: &Scene,
        plan: &FloorPlan,
        rings: &WallRings,
        is_empty: &mut [bool],
        has_contact: &mut [bool],
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
                .for_each(|&ring| has_contact[ring] = true);
        }
        for cylinder in &scene.cylinders {
            rings.around(cylinder.center).for_each(|ring| is_empty[ring] = false);
        }
    }
}

/// Returns `true` if a point lies inside closed sides (even-odd rule; undefined on a side).
pub(super) fn contains(sides: &[(DVec2, DVec2)], point: DVec2) -> bool {
    let corners: Vec<DVec2> = sides.iter().map(|&(a, _)| a).collect();
    encloses(&corners, point)
}
