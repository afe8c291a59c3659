//! Scenes: walls and cylinders with materials, and named poses.
//!
//! [`Scene::from_json`] parses and validates a scene file; faults are returned as a [`SceneError`]
//! with line, column and the valid values. [`shipped`] holds the scenes included in the program.

mod builder;
mod check;
mod error;
mod file;
mod floor_plan;
mod locate;
mod material;
mod outline;
mod parse;
mod pose;
mod prescan;
mod rewrite;
mod robot;
mod schema;
pub mod shipped;
mod surfaces;
#[cfg(test)]
mod tests;

pub use builder::SceneBuilder;
pub use error::{SceneError, SceneProblem, sanitize, suggest};
pub use floor_plan::{DEFAULT_SNAP_M, FloorPlan, PlanChange};
pub use material::{Material, MaterialProperty};
pub use pose::{PoseError, parse_pose};
pub use robot::{Robot, RobotShape};
pub use schema::json_schema;
pub use surfaces::Surfaces;

use std::{collections::BTreeMap, sync::Arc};

use crate::geometry::{DVec2, Pose, distance_to_segment};

/// Validated scene: every wall has a length, every material is defined.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Scene name, not empty.
    pub name: String,
    /// Source of the dimensions.
    pub source: Option<String>,
    /// Approximations and assumptions, one sentence each.
    pub approximate: Vec<String>,
    /// Surfaces by name, including unused ones.
    pub materials: BTreeMap<String, Material>,
    /// Flat reflectors, one segment each.
    pub walls: Vec<Wall>,
    /// Upright circular reflectors of the scene.
    pub cylinders: Vec<Cylinder>,
    /// Height of the floor, metres; `None` for a scene in the plane.
    pub floor_z_m: Option<f64>,
    /// Height of the ceiling, metres.
    pub ceiling_z_m: Option<f64>,
    /// Material of the floor; sound scattered by it is not modelled.
    pub floor_material: Material,
    /// Material of the ceiling.
    pub ceiling_material: Material,
    /// Snap tolerance, metres: ends closer than this are joined; see [`FloorPlan`].
    pub snap_m: f64,
    /// Named poses of the ranger.
    pub poses: BTreeMap<String, Pose>,
    /// Body of the robot that carries the ranger; see [`Scene::with_robot_at`].
    pub robot: Option<Robot>,
    /// SHA-256 of the source text, hexadecimal.
    pub sha256: String,
    /// Source text of the scene file.
    pub text: Arc<str>,
}

impl Scene {
    /// Parses and validates the text of a scene file.
    ///
    /// # Errors
    /// Returns the first fault: syntax, an unknown or missing field, a wrong type, or a violated
    /// rule (an undefined material, a wall of zero length, ...). Never panics, whatever the input.
    pub fn from_json(text: &str) -> Result<Self, SceneError> {
        parse::scene_from_json(text)
    }

    /// Distance of a point from the nearest wall or cylinder, metres; negative inside a cylinder,
    /// infinite in an empty scene.
    #[must_use]
    pub fn clearance_m(&self, at: DVec2) -> f64 {
        let walls = self.walls.iter().map(|wall| distance_to_segment(at, wall.a, wall.b));
        let round = self.cylinders.iter().map(|c| at.distance(c.center) - c.radius_m);
        walls.chain(round).fold(f64::INFINITY, f64::min)
    }
}

/// Flat reflector: one segment of the floor plan. Both faces reflect.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// Identifier; segments of a polyline are `id.0`, `id.1`, ...
    pub id: Arc<str>,
    /// Position of the first end, metres.
    pub a: DVec2,
    /// Position of the second end, metres.
    pub b: DVec2,
    /// Surface material of the wall.
    pub material: Material,
    /// Lower and upper height, metres; `None`: unbounded.
    pub z_m: Option<[f64; 2]>,
}

/// Upright circular reflector: a pillar, a table leg.
#[derive(Debug, Clone, PartialEq)]
pub struct Cylinder {
    /// Identifier of the cylinder.
    pub id: Arc<str>,
    /// Position of the axis, metres.
    pub center: DVec2,
    /// Radius of the cylinder, metres.
    pub radius_m: f64,
    /// Surface material of the cylinder.
    pub material: Material,
    /// Lower and upper height, metres; `None`: unbounded.
    pub z_m: Option<[f64; 2]>,
}
