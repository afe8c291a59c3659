//! The body of the robot that carries the ranger.

use std::sync::Arc;

use super::{Cylinder, Material, PoseError, Scene, Wall, outline::contains};
use crate::geometry::{DVec2, Pose, distance_to_segment};

/// A robot's body, in a frame that moves and turns with the pose.
///
/// The frame's origin is the ranger's rotation axis, x points along the heading and y to the
/// left of it. The body stays where it is while the ranger turns. Engines need not know
/// bodies: [`Scene::with_robot_at`] gives a scene in which the body stands among the reflectors.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// Its name.
    pub id: Arc<str>,
    /// Its outline.
    pub shape: RobotShape,
    /// Its surface.
    pub material: Material,
    /// From and to what height it stands, metres; `None`: without end.
    pub z_m: Option<[f64; 2]>,
}

/// Outline of a body in the robot's frame. The ranger is outside it.
#[derive(Debug, Clone, PartialEq)]
pub enum RobotShape {
    /// Round.
    Circle {
        /// Its centre, metres.
        center: DVec2,
        /// Its radius, metres.
        radius_m: f64,
    },
    /// Flat sides between these corners, metres; the last is joined to the first.
    Outline(Vec<DVec2>),
}

impl Robot {
    /// The body's sides in the world, with the ranger at `pose`; none for a round body.
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

    /// Whether the body, with the ranger at `pose`, touches the segment `a`-`b` or has it inside.
    fn meets_segment(&self, pose: &Pose, a: DVec2, b: DVec2) -> bool {
        if let RobotShape::Circle { center, radius_m } = self.shape {
            return distance_to_segment(to_world(pose, center), a, b) < radius_m;
        }
        let sides = self.sides_at(pose);
        contains(&sides, a) || sides.iter().any(|&(c, d)| cross(a, b, c, d))
    }

    /// Whether the body, with the ranger at `pose`, touches a circle or has it inside.
    fn meets_circle(&self, pose: &Pose, around: DVec2, reach_m: f64) -> bool {
        if let RobotShape::Circle { center, radius_m } = self.shape {
            return to_world(pose, center).distance(around) < radius_m + reach_m;
        }
        let sides = self.sides_at(pose);
        contains(&sides, around)
            || sides.iter().any(|&(c, d)| distance_to_segment(around, c, d) < reach_m)
    }
}

impl Scene {
    /// This scene with the robot's body among its reflectors, for a ranger at `pose`; sides of
    /// a body with flat sides are called `id.0`, `id.1`, ... Without a robot, a plain copy.
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

    /// Name of a wall that stands between two places, if there is one.
    #[must_use]
    pub fn wall_between(&self, from: DVec2, to: DVec2) -> Option<&str> {
        let between = self.walls.iter().find(|wall| cross(from, to, wall.a, wall.b));
        between.map(|wall| &*wall.id)
    }

    /// Whether the robot's body fits at a pose.
    pub(super) fn check_robot(&self, pose: &Pose) -> Result<(), PoseError> {
        let Some(robot) = &self.robot else { return Ok(()) };
        let wall = self.walls.iter().find(|wall| robot.meets_segment(pose, wall.a, wall.b));
        let cylinder =
            || self.cylinders.iter().find(|c| robot.meets_circle(pose, c.center, c.radius_m));
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

/// Whether two segments cross or touch.
fn cross(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    let side = |p: DVec2, q: DVec2, r: DVec2| (q - p).perp_dot(r - p);
    let (c_side, d_side) = (side(a, b, c), side(a, b, d));
    let (a_side, b_side) = (side(c, d, a), side(c, d, b));
    let parallel = c_side == 0.0 && d_side == 0.0;
    !parallel && c_side * d_side <= 0.0 && a_side * b_side <= 0.0
}
