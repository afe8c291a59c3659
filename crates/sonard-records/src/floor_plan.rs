//! A scene as it is drawn.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use sonard_model::{
    geometry::Pose,
    scene::{Material, RobotShape, Scene},
};

/// A point of a floor plan: x and y, metres.
pub type PlanPoint = [f64; 2];

/// A scene: everything that a drawn floor plan shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FloorPlan {
    /// Its name.
    pub name: String,
    /// SHA-256 of its file, hexadecimal, as sessions of logs have it.
    pub sha256: String,
    /// Flat reflectors.
    pub walls: Vec<WallLine>,
    /// Upright round reflectors.
    pub cylinders: Vec<Circle>,
    /// The body that carries the ranger, if the scene has one.
    pub robot: Option<Body>,
    /// Named poses.
    pub poses: BTreeMap<String, Pose>,
}

/// A flat reflector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WallLine {
    /// Its name.
    pub id: String,
    /// One end.
    pub from: PlanPoint,
    /// The other.
    pub to: PlanPoint,
    /// What it is made of.
    pub material: Material,
}

/// An upright round reflector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Circle {
    /// Its name.
    pub id: String,
    /// Its axis.
    pub center: PlanPoint,
    /// Its radius, metres.
    pub radius_m: f64,
    /// What it is made of.
    pub material: Material,
}

/// A body in its own frame: the ranger's axis is its origin, x its heading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Body {
    /// Its name.
    pub id: String,
    /// Corners of one with flat sides.
    pub outline: Vec<PlanPoint>,
    /// Centre of a round one.
    pub center: Option<PlanPoint>,
    /// Radius of a round one, metres.
    pub radius_m: Option<f64>,
}

impl FloorPlan {
    /// Of a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
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
