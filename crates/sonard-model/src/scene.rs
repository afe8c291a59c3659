//! Scenes: walls and cylinders of some material, and named poses.
//!
//! [`Scene::from_json`] reads a scene file and checks it; what is wrong comes back as a
//! [`SceneError`] with line, column and what would be right. [`shipped`] holds the scenes that
//! come with the program.

mod builder;
mod check;
mod error;
mod file;
mod floor_plan;
mod locate;
mod outline;
mod parse;
mod plain;
mod pose;
mod rewrite;
mod robot;
mod schema;
pub mod shipped;
mod surfaces;
#[cfg(test)]
mod tests;

pub use builder::SceneBuilder;
pub use error::{SceneError, SceneProblem, shown, suggest};
pub use floor_plan::{Change, DEFAULT_SNAP_M, FloorPlan};
pub use pose::{PoseError, parse_pose};
pub use robot::{Robot, RobotShape};
pub use schema::json_schema;
pub use surfaces::Surfaces;

use std::{collections::BTreeMap, sync::Arc};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::{DVec2, Pose, distance_to_segment};

/// A checked scene: every wall has a length, every material is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The scene's name.
    pub name: String,
    /// Where its dimensions come from.
    pub source: Option<String>,
    /// What in it is approximate, one sentence each.
    pub approximate: Vec<String>,
    /// Surfaces by name, also those that nothing is made of.
    pub materials: BTreeMap<String, Material>,
    /// Flat reflectors, one segment each.
    pub walls: Vec<Wall>,
    /// Upright circular reflectors.
    pub cylinders: Vec<Cylinder>,
    /// Height of the floor, metres; `None` for a scene in the plane.
    pub floor_z_m: Option<f64>,
    /// Height of the ceiling, metres.
    pub ceiling_z_m: Option<f64>,
    /// The floor's surface; what it scatters is lost to the model.
    pub floor_material: Material,
    /// The ceiling's.
    pub ceiling_material: Material,
    /// What is drawn closer together than this was meant to meet, metres; see [`FloorPlan`].
    pub snap_m: f64,
    /// Named poses of the ranger.
    pub poses: BTreeMap<String, Pose>,
    /// Body of the robot that carries the ranger; see [`Scene::with_robot_at`].
    pub robot: Option<Robot>,
    /// SHA-256 of the text it was read from, hexadecimal.
    pub sha256: String,
    /// That text.
    pub text: Arc<str>,
}

impl Scene {
    /// Reads the text of a scene file and checks it.
    ///
    /// # Errors
    /// The first fault: syntax, an unknown or missing field, a wrong type, or a rule of scenes
    /// that is broken (a material that is not there, a wall without length, ...). No input
    /// makes it panic.
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

/// Acoustic properties of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
pub struct Material {
    /// Amplitude of the mirror reflection relative to the incident wave, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub reflectance: f64,
    /// Share of what is not absorbed that is scattered instead of mirrored, 0 to 1.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub roughness: f64,
}

impl Material {
    /// A perfect mirror.
    pub const RIGID: Self = Self { reflectance: 1.0, roughness: 0.0 };
}

/// A flat reflector: one segment of the floor plan. Both faces reflect.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// Its name; segments of a polyline are `id.0`, `id.1`, ...
    pub id: Arc<str>,
    /// One end, metres.
    pub a: DVec2,
    /// The other end, metres.
    pub b: DVec2,
    /// Its surface.
    pub material: Material,
    /// From and to what height it stands, metres; `None`: without end.
    pub z_m: Option<[f64; 2]>,
}

/// An upright circular reflector.
#[derive(Debug, Clone, PartialEq)]
pub struct Cylinder {
    /// Its name.
    pub id: Arc<str>,
    /// Its axis, metres.
    pub center: DVec2,
    /// Its radius, metres.
    pub radius_m: f64,
    /// Its surface.
    pub material: Material,
    /// From and to what height it stands, metres; `None`: without end.
    pub z_m: Option<[f64; 2]>,
}
