//! Ray casting: nearest reflector along a ray.

use crate::{
    geometry::DVec2,
    model::{Edge, Reflector},
    scene::{Cylinder, FloorPlan, Scene},
};

/// Offset of a ray from the surface it leaves, metres, to avoid hitting the same surface.
const START_M: f64 = 1e-9;
/// Walls that share an end leave no gap between them at this size, metres.
const JOINT_M: f64 = 1e-12;

/// Intersection of a ray with a reflector.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// Distance from the ray's origin, metres.
    pub distance_m: f64,
    /// The reflector that was hit.
    pub(super) reflector: Reflector,
    /// Unit normal of the surface there: outward on a cylinder, to either side on a wall.
    pub(super) normal: DVec2,
    /// Distance from the nearer end of the wall, metres, negative beyond it; infinite on a
    /// cylinder.
    pub(super) from_end_m: f64,
}

/// Reflectors of a scene, prepared for ray casting.
#[derive(Debug)]
pub struct Reflectors {
    /// Segments by wall, from end to end.
    walls: Vec<WallSegment>,
    /// Parts of each wall that no other wall covers.
    segments: Vec<(u32, WallSegment)>,
    circles: Vec<CylinderCircle>,
}

#[derive(Debug)]
struct WallSegment {
    start: DVec2,
    along: DVec2,
    length_m: f64,
    mirror: f64,
}

#[derive(Debug)]
struct CylinderCircle {
    center: DVec2,
    radius_m: f64,
    mirror: f64,
}

impl Reflectors {
    /// Prepares the reflectors of a scene and its floor plan.
    #[must_use]
    pub fn new(scene: &Scene, plan: &FloorPlan) -> Self {
        let mirror = |wall: u32| scene.walls[wall as usize].material.mirror_amplitude();
        let walls = plan.walls.iter().zip(0..);
        let stretches = plan.uncovered_stretches();
        Self {
            walls: walls.map(|(&ends, wall)| WallSegment::new(ends, mirror(wall))).collect(),
            segments: stretches
                .into_iter()
                .map(|(wall, ends)| (wall, WallSegment::new(ends, mirror(wall))))
                .collect(),
            circles: scene.cylinders.iter().map(CylinderCircle::new).collect(),
        }
    }

    /// Finds the nearest reflector from `origin` along the unit vector `direction`, except the one
    /// it starts on: a ray never hits the same flat wall twice in a row.
    pub fn nearest(
        &self,
        origin: DVec2,
        direction: DVec2,
        leaving: Option<Reflector>,
    ) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let mut keep = |hit: Hit| {
            if best.is_none_or(|known| hit.distance_m < known.distance_m) {
                best = Some(hit);
            }
        };
        for (wall, segment) in &self.segments {
            let reflector = Reflector::Wall(*wall);
            if leaving != Some(reflector)
                && let Some(hit) = segment.intersect(origin, direction, reflector)
            {
                keep(hit);
            }
        }
        for (circle, index) in self.circles.iter().zip(0..) {
            if let Some(hit) = circle.intersect(origin, direction, Reflector::Cylinder(index)) {
                keep(hit);
            }
        }
        best
    }

    /// Intersects a ray with one of the reflectors, walls as infinite lines and all others ignored;
    /// `None` if it is parallel to the wall or misses the cylinder.
    pub(super) fn intersect(
        &self,
        origin: DVec2,
        direction: DVec2,
        reflector: Reflector,
    ) -> Option<Hit> {
        match reflector {
            Reflector::Wall(index) => {
                self.walls[index as usize].intersect_line(origin, direction, reflector)
            }
            Reflector::Cylinder(index) => {
                self.circles[index as usize].intersect(origin, direction, reflector)
            }
            Reflector::Floor | Reflector::Ceiling => None,
        }
    }

    /// Returns `true` if nothing is between two points; an object that touches `to` does not count.
    pub(super) fn sees(&self, from: DVec2, to: DVec2) -> bool {
        let run = to - from;
        let distance_m = run.length();
        self.nearest(from, run / distance_m, None)
            .is_none_or(|hit| hit.distance_m > distance_m - 1e-7)
    }

    /// Reflectance of the amplitude, 0 to 1.
    pub(super) fn mirror(&self, reflector: Reflector) -> f64 {
        match reflector {
            Reflector::Wall(index) => self.walls[index as usize].mirror,
            Reflector::Cylinder(index) => self.circles[index as usize].mirror,
            Reflector::Floor | Reflector::Ceiling => 0.0,
        }
    }

    /// Radius of curvature of a surface, metres; `None` for a flat one.
    pub(super) fn radius_m(&self, reflector: Reflector) -> Option<f64> {
        match reflector {
            Reflector::Wall(_) | Reflector::Floor | Reflector::Ceiling => None,
            Reflector::Cylinder(index) => Some(self.circles[index as usize].radius_m),
        }
    }

    /// Returns the point of an edge.
    pub(super) fn edge_point(&self, edge: Edge) -> DVec2 {
        let segment = &self.walls[edge.wall as usize];
        if edge.at_b { segment.start + segment.length_m * segment.along } else { segment.start }
    }
}

impl WallSegment {
    fn new((a, b): (DVec2, DVec2), mirror: f64) -> Self {
        let run = b - a;
        let length_m = run.length();
        Self { start: a, along: run / length_m, length_m, mirror }
    }

    fn intersect(&self, origin: DVec2, direction: DVec2, reflector: Reflector) -> Option<Hit> {
        self.intersect_line(origin, direction, reflector)
            .filter(|hit| hit.distance_m > START_M && hit.from_end_m >= -JOINT_M)
    }

    /// Intersects the line through the segment, ahead or behind.
    fn intersect_line(&self, origin: DVec2, direction: DVec2, reflector: Reflector) -> Option<Hit> {
        let slant = direction.perp_dot(self.along);
        if slant.abs() < 1e-15 {
            return None;
        }
        let to_start = self.start - origin;
        let position_m = to_start.perp_dot(direction) / slant;
        Some(Hit {
            distance_m: to_start.perp_dot(self.along) / slant,
            reflector,
            normal: self.along.perp(),
            from_end_m: position_m.min(self.length_m - position_m),
        })
    }
}

impl CylinderCircle {
    fn new(cylinder: &Cylinder) -> Self {
        Self {
            center: cylinder.center,
            radius_m: cylinder.radius_m,
            mirror: cylinder.material.mirror_amplitude(),
        }
    }

    fn intersect(&self, origin: DVec2, direction: DVec2, reflector: Reflector) -> Option<Hit> {
        let to_center = self.center - origin;
        let foot_m = to_center.dot(direction);
        let offset_m = to_center.perp_dot(direction);
        let half_chord_m = (self.radius_m - offset_m.abs()) * (self.radius_m + offset_m.abs());
        if half_chord_m < 0.0 {
            return None;
        }
        let half_chord_m = half_chord_m.sqrt();
        let distance_m = [foot_m - half_chord_m, foot_m + half_chord_m]
            .into_iter()
            .find(|&distance_m| distance_m > START_M)?;
        let normal = (origin + distance_m * direction - self.center) / self.radius_m;
        Some(Hit { distance_m, reflector, normal, from_end_m: f64::INFINITY })
    }
}
