//! The nearest reflector along a ray.

use crate::{
    geometry::DVec2,
    model::{Edge, Reflector},
    scene::{Cylinder, FloorPlan, Material, Scene},
};

/// A ray starts this far off the surface it leaves, metres, so as not to meet it again.
const START_M: f64 = 1e-9;
/// Walls that share an end leave no gap between them at this size, metres.
const JOINT_M: f64 = 1e-12;

/// A point where a ray meets a reflector.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// From the ray's origin, metres.
    pub distance_m: f64,
    /// The reflector.
    pub(super) reflector: Reflector,
    /// Unit normal of the surface there; out of a cylinder, to either side of a wall.
    pub(super) normal: DVec2,
    /// From the nearer end of the wall, metres, negative beyond it; endless on a cylinder.
    pub(super) from_end_m: f64,
}

/// A scene's reflectors, ready for ray casts.
#[derive(Debug)]
pub struct Reflectors {
    /// By wall, from end to end.
    walls: Vec<Segment>,
    /// What of each wall no other one covers.
    segments: Vec<(u32, Segment)>,
    circles: Vec<Circle>,
}

#[derive(Debug)]
struct Segment {
    start: DVec2,
    along: DVec2,
    length_m: f64,
    mirror: f64,
}

#[derive(Debug)]
struct Circle {
    center: DVec2,
    radius_m: f64,
    mirror: f64,
}

impl Reflectors {
    /// Those of a scene and its plan.
    #[must_use]
    pub fn new(scene: &Scene, plan: &FloorPlan) -> Self {
        let mirror = |wall: u32| mirrored(&scene.walls[wall as usize].material);
        let walls = plan.walls.iter().zip(0..);
        let stretches = plan.stretches();
        Self {
            walls: walls.map(|(&ends, wall)| Segment::new(ends, mirror(wall))).collect(),
            segments: stretches
                .into_iter()
                .map(|(wall, ends)| (wall, Segment::new(ends, mirror(wall))))
                .collect(),
            circles: scene.cylinders.iter().map(Circle::new).collect(),
        }
    }

    /// The nearest reflector from `origin` along the unit vector `direction`, leaving out the
    /// one it starts on: a ray never meets the same flat wall twice in a row.
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
                && let Some(hit) = segment.meet(origin, direction, reflector)
            {
                keep(hit);
            }
        }
        for (circle, index) in self.circles.iter().zip(0..) {
            if let Some(hit) = circle.meet(origin, direction, Reflector::Cylinder(index)) {
                keep(hit);
            }
        }
        best
    }

    /// The hit of a ray on one of the reflectors, walls taken without their ends and others out of the way;
    /// `None` if it is parallel to the wall or misses the cylinder.
    pub(super) fn meet(
        &self,
        origin: DVec2,
        direction: DVec2,
        reflector: Reflector,
    ) -> Option<Hit> {
        match reflector {
            Reflector::Wall(index) => {
                self.walls[index as usize].meet_line(origin, direction, reflector)
            }
            Reflector::Cylinder(index) => {
                self.circles[index as usize].meet(origin, direction, reflector)
            }
            Reflector::Floor | Reflector::Ceiling => None,
        }
    }

    /// Whether nothing stands between two points; what touches `to` does not count.
    pub(super) fn sees(&self, from: DVec2, to: DVec2) -> bool {
        let run = to - from;
        let distance_m = run.length();
        self.nearest(from, run / distance_m, None)
            .is_none_or(|hit| hit.distance_m > distance_m - 1e-7)
    }

    /// Amplitude that a reflector mirrors, 0 to 1.
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

    /// The point of an edge.
    pub(super) fn edge_point(&self, edge: Edge) -> DVec2 {
        let segment = &self.walls[edge.wall as usize];
        if edge.at_b { segment.start + segment.length_m * segment.along } else { segment.start }
    }
}

/// Amplitude mirrored by a material. Roughness is a share of the energy, hence the root; what
/// it scatters is lost to the ray engines.
fn mirrored(material: &Material) -> f64 {
    material.reflectance * (1.0 - material.roughness).sqrt()
}

impl Segment {
    fn new((a, b): (DVec2, DVec2), mirror: f64) -> Self {
        let run = b - a;
        let length_m = run.length();
        Self { start: a, along: run / length_m, length_m, mirror }
    }

    fn meet(&self, origin: DVec2, direction: DVec2, reflector: Reflector) -> Option<Hit> {
        self.meet_line(origin, direction, reflector)
            .filter(|hit| hit.distance_m > START_M && hit.from_end_m >= -JOINT_M)
    }

    /// The same on the line through it, ahead or behind.
    fn meet_line(&self, origin: DVec2, direction: DVec2, reflector: Reflector) -> Option<Hit> {
        let slant = direction.perp_dot(self.along);
        if slant.abs() < 1e-15 {
            return None;
        }
        let to_start = self.start - origin;
        let place_m = to_start.perp_dot(direction) / slant;
        Some(Hit {
            distance_m: to_start.perp_dot(self.along) / slant,
            reflector,
            normal: self.along.perp(),
            from_end_m: place_m.min(self.length_m - place_m),
        })
    }
}

impl Circle {
    fn new(cylinder: &Cylinder) -> Self {
        Self {
            center: cylinder.center,
            radius_m: cylinder.radius_m,
            mirror: mirrored(&cylinder.material),
        }
    }

    fn meet(&self, origin: DVec2, direction: DVec2, reflector: Reflector) -> Option<Hit> {
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
