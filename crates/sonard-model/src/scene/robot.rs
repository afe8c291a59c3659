//! Body of the robot that carries the ranger.

use std::sync::Arc;

use super::{
    Cylinder, FloorPlan, Material, PoseError, Scene, Wall, outline::contains, pose::CLEARANCE_M,
};
use crate::geometry::{DVec2, Pose, distance_to_segment};

/// Body of a robot, in the robot's frame.
///
/// The origin of the frame is the ranger's rotation axis, x points along the heading and y to the
/// left. The body does not rotate with the ranger. Engines do not handle bodies:
/// [`Scene::with_robot_at`] returns a scene with the body among the reflectors.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// Identifier of the body.
    pub id: Arc<str>,
    /// Outline in the robot's frame.
    pub shape: RobotShape,
    /// Surface material of the body.
    pub material: Material,
    /// Lower and upper height, metres; `None`: unbounded.
    pub z_m: Option<[f64; 2]>,
}

/// Outline of a body in the robot's frame. The ranger is outside the outline.
#[derive(Debug, Clone, PartialEq)]
pub enum RobotShape {
    /// Circular outline of the body.
    Circle {
        /// Centre in the robot's frame, metres.
        center: DVec2,
        /// Radius of the circle, metres.
        radius_m: f64,
    },
    /// Polygon of these corners, metres; implicitly closed.
    Outline(Vec<DVec2>),
}

impl Robot {
    /// World coordinates of the body's sides, with the ranger at `pose`; empty for a circular body.
    fn sides_at(&self, pose: &Pose) -> Vec<(DVec2, DVec2)> {
        match &self.shape {
            RobotShape::Circle { .. } => Vec::new(),
            RobotShape::Outline(corners) => {
                let corners: Vec<_> =
                    corners.iter().map(|&corner| to_world(pose, corner)).collect();
                let next = corners.iter().cycle().skip(1);
                corners.iter().copied().zip(next.copied()).collect()
            }
        }
    }

    /// Returns whether a position is inside the body, with the ranger at `pose`, and its distance
    /// from the body's surface, metres.
    fn off_surface(&self, pose: &Pose, place: DVec2) -> (bool, f64) {
        if let RobotShape::Circle { center, radius_m } = self.shape {
            let off_m = to_world(pose, center).distance(place) - radius_m;
            return (off_m < 0.0, off_m.abs());
        }
        let sides = self.sides_at(pose);
        let off_m = sides.iter().map(|&(a, b)| distance_to_segment(place, a, b));
        (contains(&sides, place), off_m.fold(f64::INFINITY, f64::min))
    }

    /// Returns `true` if the body, with the ranger at `pose`, touches or contains the segment
    /// `a`-`b`.
    fn intersects_segment(&self, pose: &Pose, a: DVec2, b: DVec2) -> bool {
        if let RobotShape::Circle { center, radius_m } = self.shape {
            return distance_to_segment(to_world(pose, center), a, b) < radius_m;
        }
        let sides = self.sides_at(pose);
        contains(&sides, a) || sides.iter().any(|&(c, d)| cross(a, b, c, d))
    }

    /// Returns `true` if the body, with the ranger at `pose`, touches or contains a circle.
    fn intersects_circle(&self, pose: &Pose, around: DVec2, reach_m: f64) -> bool {
        if let RobotShape::Circle { center, radius_m } = self.shape {
            return to_world(pose, center).distance(around) < radius_m + reach_m;
        }
        let sides = self.sides_at(pose);
        contains(&sides, around)
            || sides.iter().any(|&(c, d)| distance_to_segment(around, c, d) < reach_m)
    }
}

impl Scene {
    /// Copy of the scene with the robot's body among its reflectors, for a ranger at `pose`. Sides
    /// of a polygonal body are named `id.0`, `id.1`, ... Without a robot, a plain copy.
    #[must_use]
    pub fn with_robot_at(&self, pose: &Pose) -> Self {
        let mut scene = self.clone();
        let Some(robot) = scene.robot.take() else { return scene };
        if let RobotShape::Circle { center, radius_m } = robot.shape {
            let (material, z_m) = (robot.material, robot.z_m);
            let center = to_world(pose, center);
            scene.cylinders.push(Cylinder { id: robot.id, center, radius_m, material, z_m });
            return scene;
        }
        scene.walls.extend(robot.sides_at(pose).into_iter().enumerate().map(|(index, (a, b))| {
            Wall {
                id: format!("{}.{index}", robot.id).into(),
                a,
                b,
                material: robot.material,
                z_m: robot.z_m,
            }
        }));
        scene
    }

    /// Checks that a position is outside the robot's body and off its surface.
    pub(super) fn check_off_robot(
        &self,
        pose: &Pose,
        place: DVec2,
        room: Option<[[f64; 2]; 2]>,
    ) -> Result<(), PoseError> {
        let Some(robot) = &self.robot else { return Ok(()) };
        let (inside, distance_m) = robot.off_surface(pose, place);
        let DVec2 { x: x_m, y: y_m } = place;
        let name = robot.id.to_string();
        if distance_m < CLEARANCE_M {
            return Err(PoseError::TooClose { x_m, y_m, reflector: name, distance_m, room });
        }
        if inside { Err(PoseError::InsideBody { x_m, y_m, body: name, room }) } else { Ok(()) }
    }

    /// Checks that the robot's body fits at a pose.
    pub(super) fn check_robot(&self, plan: &FloorPlan, pose: &Pose) -> Result<(), PoseError> {
        let Some(robot) = &self.robot else { return Ok(()) };
        let walls = self.walls.iter().zip(&plan.walls);
        let mut hits = walls.filter(|(_, (a, b))| robot.intersects_segment(pose, *a, *b));
        let wall = hits.next().map(|(wall, _)| wall);
        let cylinder =
            || self.cylinders.iter().find(|c| robot.intersects_circle(pose, c.center, c.radius_m));
        match wall.map(|wall| &wall.id).or_else(|| cylinder().map(|cylinder| &cylinder.id)) {
            None => Ok(()),
            Some(reflector) => Err(PoseError::BodyCollides {
                x_m: pose.x_m,
                y_m: pose.y_m,
                heading_deg: pose.heading_deg,
                robot: robot.id.to_string(),
                reflector: reflector.to_string(),
            }),
        }
    }
}

fn to_world(pose: &Pose, point: DVec2) -> DVec2 {
    pose.position() + DVec2::from_angle(pose.direction_rad(0.0)).rotate(point)
}

/// Index of a plan's wall between two positions, if there is one.
pub(super) fn wall_between(plan: &FloorPlan, from: DVec2, to: DVec2) -> Option<usize> {
    plan.walls.iter().position(|&(a, b)| cross(from, to, a, b))
}

/// Returns `true` if two segments cross or touch.
fn cross(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    let side = |p: DVec2, q: DVec2, r: DVec2| (q - p).perp_dot(r - p);
    let (c_side, d_side) = (side(a, b, c), side(a, b, d));
    let (a_side, b_side) = (side(c, d, a), side(c, d, b));
    let parallel = c_side == 0.0 && d_side == 0.0;
    !parallel && c_side * d_side <= 0.0 && a_side * b_side <= 0.0
}
