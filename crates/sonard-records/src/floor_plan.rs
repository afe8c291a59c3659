//! Floor plan of a scene, for drawing.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use sonard_model::{
    geometry::Pose,
    scene::{Material, RobotShape, Scene},
};

/// Point of a floor plan: x and y, metres.
pub type PlanPoint = [f64; 2];

/// Elements of a scene that a drawn floor plan shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FloorPlan {
    /// Name of the scene.
    pub name: String,
    /// SHA-256 of the scene file, hexadecimal, as in sessions of logs.
    pub sha256: String,
    /// Flat reflectors of the scene.
    pub walls: Vec<WallLine>,
    /// Upright circular reflectors of the scene.
    pub cylinders: Vec<Circle>,
    /// Body of the robot that carries the ranger, if the scene has one.
    pub robot: Option<Body>,
    /// Named poses of the ranger.
    pub poses: BTreeMap<String, Pose>,
}

/// Flat reflector in the plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WallLine {
    /// Identifier of the wall.
    pub id: String,
    /// Position of the first end, metres.
    pub from: PlanPoint,
    /// Position of the second end, metres.
    pub to: PlanPoint,
    /// Surface material of the wall.
    pub material: Material,
}

/// Upright circular reflector in the plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Circle {
    /// Identifier of the cylinder.
    pub id: String,
    /// Position of the axis, metres.
    pub center: PlanPoint,
    /// Radius of the cylinder, metres.
    pub radius_m: f64,
    /// Surface material of the cylinder.
    pub material: Material,
}

/// Body of a robot, in the robot's frame: the origin is the ranger's axis, x points along the
/// heading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Body {
    /// Identifier of the body.
    pub id: String,
    /// Corners of a polygonal body.
    pub outline: Vec<PlanPoint>,
    /// Centre of a circular body.
    pub center: Option<PlanPoint>,
    /// Radius of a circular body, metres.
    pub radius_m: Option<f64>,
}

impl FloorPlan {
    /// Extracts the floor plan of a scene.
    #[must_use]
    pub fn from_scene(scene: &Scene) -> Self {
        Self {
            name: scene.name.clone(),
            sha256: scene.sha256.clone(),
            walls: scene
                .walls
                .iter()
                .map(|wall| WallLine {
                    id: wall.id.to_string(),
                    from: wall.a.to_array(),
                    to: wall.b.to_array(),
                    material: wall.material,
                })
                .collect(),
            cylinders: scene
                .cylinders
                .iter()
                .map(|cylinder| Circle {
                    id: cylinder.id.to_string(),
                    center: cylinder.center.to_array(),
                    radius_m: cylinder.radius_m,
                    material: cylinder.material,
                })
                .collect(),
            robot: scene.robot.as_ref().map(|robot| match &robot.shape {
                RobotShape::Circle { center, radius_m } => Body {
                    id: robot.id.to_string(),
                    outline: Vec::new(),
                    center: Some(center.to_array()),
                    radius_m: Some(*radius_m),
                },
                RobotShape::Outline(corners) => Body {
                    id: robot.id.to_string(),
                    outline: corners.iter().copied().map(PlanPoint::from).collect(),
                    center: None,
                    radius_m: None,
                },
            }),
            poses: scene.poses.clone(),
        }
    }
}
