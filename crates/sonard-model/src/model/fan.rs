//! Ray model of Dudek, Jenkin, Milios and Wilkes: a fan of rays, mirror reflections and diffraction
//! at the ends of walls.
//!
//! Their appendix A fires a fan of rays for one direction, keeps the rays' next intersections in a
//! heap ordered by distance, and stops at the first that is detected. The rays' paths, however, do
//! not depend on the direction; it only weights them. [`Engine::arrivals_at`] therefore traces one
//! fan over the full circle for an observation point and weights it per direction. That gives every
//! arrival, not just the first, and since all are needed no heap is required. [`Fan::first_echo`]
//! is the appendix as printed, heap included, and a test compares the two.
//!
//! Choices where the paper leaves room:
//! - The ranger is transparent: a ray that reaches the receiver too early or too weak, or from
//!   behind, continues. (The paper's false lower wall needs sound to pass the ranger, and its
//!   authors state that their simulated body is smaller than the real one.)
//! - A ray that passes the receiver next to its centre represents its neighbour through the centre:
//!   length and both angles are those of the neighbour, found from the curvature of the wave front
//!   (for flat walls: from the image of the source, exactly).
//! - Edges diffract wherever a wall ends, also where it joins another, unless that one continues
//!   straight. The ray goes from the edge straight to the receiver; the same path backwards
//!   (straight out, back over walls) is omitted, as in the paper.
//! - Cylinders widen the ray tube by geometric optics; the paper has flat walls only. Beyond a
//!   round body rays diverge so fast that some paths which touch it more than once are missed at
//!   any spacing: next to a robot's body about one reading in twenty depends on the spacing.
//! - Everything happens in the plane: heights in the scene are ignored.

mod arrivals;
mod ray;

use std::{
    cmp::Ordering,
    collections::{BinaryHeap, HashMap},
    f64::consts::TAU,
};

use arrivals::FanArrivals;
use ray::FanRay;
use smallvec::SmallVec;

use super::{Arrival, Arrivals, Edge, Engine, Reflector, TooCostly, raycast::Reflectors};
use crate::{
    acoustics::BeamPattern,
    geometry::DVec2,
    scene::{FloorPlan, Scene},
};

/// Ray model of Dudek et al.; see the module documentation.
#[derive(Debug)]
pub struct Fan {
    reflectors: Reflectors,
    wall_ends: WallEnds,
    beam: BeamPattern,
    settings: FanSettings,
}

/// Settings of the fan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FanSettings {
    /// Angle between rays, radians; reduced slightly to divide the circle.
    pub spacing_rad: f64,
    /// Half the width of the transducer's face, metres.
    pub half_face_m: f64,
    /// Wavelength of the carrier, metres.
    pub wavelength_m: f64,
    /// Absorption of the air, decibels per metre.
    pub absorption_db_per_m: f64,
    /// Longest path there and back, metres.
    pub max_path_m: f64,
    /// Amplitude below which a path is dropped.
    pub min_amplitude: f64,
    /// Maximum number of mirror reflections.
    pub max_order: u32,
}

impl FanSettings {
    /// Number of rays in the full circle, and the angle between them in radians.
    fn rays(&self) -> (u32, f64) {
        let count = (TAU / self.spacing_rad).ceil();
        (count as u32, TAU / count)
    }

    /// Amplitude after `length_m` of air.
    fn through_air(&self, length_m: f64) -> f64 {
        10f64.powf(-self.absorption_db_per_m * length_m / 20.0)
    }

    /// Amplitude of an edge's echo relative to a plane's, for legs of `out_m` to the edge and
    /// `back_m` back.
    ///
    /// Kuc and Siegel's `1 / (2 pi sqrt(z / lambda))` for both legs of length z. For unequal legs z
    /// is their harmonic mean, as the cylindrical wave of the edge spreads over the path back while
    /// the gain compensates for the sum of both.
    fn edge_ratio(&self, out_m: f64, back_m: f64) -> f64 {
        let mean_m = 2.0 * out_m * back_m / (out_m + back_m);
        // The ratio holds well beyond a wavelength; an edge never returns more than a plane.
        (1.0 / (TAU * (mean_m / self.wavelength_m).sqrt())).min(1.0)
    }
}

/// Ends of walls, each point once.
#[derive(Debug)]
struct WallEnds {
    /// Edges at the ends of each wall; none where the wall continues straight as another wall.
    known: Vec<SmallVec<[Edge; 2]>>,
    /// Largest reflectance of the walls that end at an edge.
    mirror: HashMap<Edge, f64>,
}

impl WallEnds {
    fn new(scene: &Scene, plan: &FloorPlan, reflectors: &Reflectors) -> Self {
        let continues = plan.straight_joints(scene);
        let mut first_at: HashMap<u32, Edge> = HashMap::new();
        let mut mirror: HashMap<Edge, f64> = HashMap::new();
        let mut known: Vec<SmallVec<[Edge; 2]>> = vec![SmallVec::new(); plan.walls.len()];
        for (ends, wall) in plan.arrangement.ends.iter().zip(0..) {
            for (&point, at_b) in ends.iter().zip([false, true]) {
                if continues.get(point as usize).copied().unwrap_or(true) {
                    continue;
                }
                let name = *first_at.entry(point).or_insert(Edge { wall, at_b });
                let strength = mirror.entry(name).or_default();
                *strength = strength.max(reflectors.mirror(Reflector::Wall(wall)));
                known[wall as usize].push(name);
            }
        }
        Self { known, mirror }
    }
}

impl Fan {
    /// Creates the model of a scene, with a beam pattern and settings.
    #[must_use]
    pub fn new(scene: &Scene, beam: BeamPattern, settings: FanSettings) -> Self {
        let plan = scene.ray_plan();
        let reflectors = Reflectors::new(scene, &plan);
        let wall_ends = WallEnds::new(scene, &plan, &reflectors);
        Self { reflectors, wall_ends, beam, settings }
    }

    /// First arrival of at least `threshold` from a path of at least `shortest_m`: appendix A step
    /// by step, for one direction.
    ///
    /// The appendix returns half its length, or the maximum range where this returns `None`.
    #[must_use]
    pub fn first_echo(
        &self,
        position: DVec2,
        direction_rad: f64,
        shortest_m: f64,
        threshold: f64,
    ) -> Option<Arrival> {
        let facing = DVec2::from_angle(direction_rad);
        let mut rays = self.fan(position);
        let mut heap = BinaryHeap::new();
        for (ray, index) in rays.iter_mut().zip(0..) {
            self.push_next(ray, index, position, &mut heap);
        }
        while let Some(event) = heap.pop() {
            if event.distance_m > self.settings.max_path_m {
                return None;
            }
            match event.kind {
                FanEventKind::Arrival(candidate) => {
                    let amplitude = candidate.weighing().amplitude(&self.beam, facing);
                    if amplitude >= threshold && candidate.length_m >= shortest_m {
                        return Some(candidate.arrival(self, position, amplitude));
                    }
                }
                FanEventKind::Wall(index, hit) => {
                    let ray = &mut rays[index as usize];
                    for candidate in ray.diffract(&hit, self, position) {
                        heap.push(FanEvent::arrival(candidate));
                    }
                    if ray.reflect(&hit, self) {
                        self.push_next(ray, index, position, &mut heap);
                    }
                }
            }
        }
        None
    }

    /// Rays over the full circle, in a grid fixed in the world.
    fn fan(&self, position: DVec2) -> Vec<FanRay> {
        // Off any symmetry of usual scenes, so that no ray points exactly at a corner.
        const PHASE: f64 = 0.381_966;
        let (count, spacing_rad) = self.settings.rays();
        (0..count).map(|i| FanRay::new(position, (f64::from(i) + PHASE) * spacing_rad)).collect()
    }

    fn push_next(
        &self,
        ray: &mut FanRay,
        index: u32,
        position: DVec2,
        heap: &mut BinaryHeap<FanEvent>,
    ) {
        let (candidate, hit) = ray.advance(self, position);
        heap.extend(candidate.map(FanEvent::arrival));
        heap.extend(hit.map(|hit| FanEvent {
            distance_m: ray.travelled_m() + hit.distance_m,
            kind: FanEventKind::Wall(index, hit),
        }));
    }
}

impl Engine for Fan {
    fn arrivals_at<'a>(&'a self, position: DVec2) -> Result<Box<dyn Arrivals + 'a>, TooCostly> {
        Ok(Box::new(FanArrivals::trace(self, position)))
    }
}

/// An entry of the heap; the one closest along its path is the greatest.
struct FanEvent {
    distance_m: f64,
    kind: FanEventKind,
}

enum FanEventKind {
    Wall(u32, super::raycast::Hit),
    Arrival(Box<ray::FanCandidate>),
}

impl FanEvent {
    fn arrival(candidate: ray::FanCandidate) -> Self {
        Self { distance_m: candidate.length_m, kind: FanEventKind::Arrival(Box::new(candidate)) }
    }
}

impl Ord for FanEvent {
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance_m.total_cmp(&self.distance_m)
    }
}

impl PartialOrd for FanEvent {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for FanEvent {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for FanEvent {}
