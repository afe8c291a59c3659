//! The scene in force, as it is drawn.

use std::collections::BTreeMap;

use axum::{extract::State, http::StatusCode, response::Response};
use schemars::JsonSchema;
use serde::Serialize;

use crate::{
    geometry::{DVec2, Pose},
    scene::{Material, RobotShape, Scene},
    server::{Api, answer::Failed, openapi::Endpoint},
};

/// A point of the floor plan: x and y, metres.
pub(super) type Point = [f64; 2];

/// The scene in force: everything that a floor plan shows.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub(super) struct FloorPlan {
    /// Its name.
    name: String,
    /// SHA-256 of its file, hexadecimal, as sessions of logs have it.
    sha256: String,
    /// Flat reflectors.
    walls: Vec<WallLine>,
    /// Upright round reflectors.
    cylinders: Vec<Circle>,
    /// The body that carries the ranger, if the scene has one.
    robot: Option<Body>,
    /// Named poses.
    poses: BTreeMap<String, Pose>,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
struct WallLine {
    id: String,
    from: Point,
    to: Point,
    material: Material,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
struct Circle {
    id: String,
    center: Point,
    radius_m: f64,
    material: Material,
}

/// A body in its own frame: the ranger's axis is its origin, x its heading.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct Body {
    id: String,
    /// Corners of one with flat sides.
    outline: Vec<Point>,
    /// Centre of a round one.
    center: Option<Point>,
    /// Radius of a round one, metres.
    radius_m: Option<f64>,
}

pub(super) fn endpoints() -> Vec<Endpoint> {
    vec![
        Endpoint::get("/v1/scene", scene, "The floor plan of the scene in force")
            .answers::<FloorPlan>(200, "The floor plan"),
    ]
}

async fn scene(State(api): State<Api>) -> Result<Response, Failed> {
    let scene = api.daemon.scene().ok_or_else(|| {
        let help = "give the daemon one with place.scene";
        Failed::new(StatusCode::NOT_FOUND, "there is no scene", help)
    })?;
    Ok(api.scene.answer(&scene, FloorPlan::of))
}

impl FloorPlan {
    pub(super) fn of(scene: &Scene) -> Self {
        Self {
            name: scene.name.clone(),
            sha256: scene.sha256.clone(),
            walls: scene
                .walls
                .iter()
                .map(|wall| WallLine {
                    id: wall.id.to_string(),
                    from: point(wall.a),
                    to: point(wall.b),
                    material: wall.material,
                })
                .collect(),
            cylinders: scene
                .cylinders
                .iter()
                .map(|cylinder| Circle {
                    id: cylinder.id.to_string(),
                    center: point(cylinder.center),
                    radius_m: cylinder.radius_m,
                    material: cylinder.material,
                })
                .collect(),
            robot: scene.robot.as_ref().map(|robot| match &robot.shape {
                RobotShape::Circle { center, radius_m } => Body {
                    id: robot.id.to_string(),
                    outline: Vec::new(),
                    center: Some(point(*center)),
                    radius_m: Some(*radius_m),
                },
                RobotShape::Outline(corners) => Body {
                    id: robot.id.to_string(),
                    outline: corners.iter().copied().map(point).collect(),
                    center: None,
                    radius_m: None,
                },
            }),
            poses: scene.poses.clone(),
        }
    }
}

pub(super) fn point(at: DVec2) -> Point {
    at.to_array()
}
