//! Body of a robot that carries an array.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ArrayError, within};
use crate::{
    geometry::DVec2,
    scene::{Material, Robot, RobotShape},
};

/// Body of a robot, in the robot's frame. The rangers' faces are outside the body; the robot's own
/// position may be inside.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Identifier of the body in records.
    pub id: String,
    /// Outline in the robot's frame.
    pub shape: BodyShape,
    /// Surface material of the body.
    pub material: Material,
    /// Lower and upper height, metres; default: unbounded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub z_m: Option<[f64; 2]>,
}

/// Outline of a body, `[forward, left]` in metres from the robot's position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BodyShape {
    /// Circular outline of the body.
    Circle {
        /// Centre, `[forward, left]` in metres.
        center: [f64; 2],
        /// Radius of the circle, metres.
        radius_m: f64,
    },
    /// Polygon of at least three corners, implicitly closed.
    Outline(Vec<[f64; 2]>),
}

impl Body {
    pub(super) fn check(&self) -> Result<(), ArrayError> {
        let corners = match &self.shape {
            BodyShape::Circle { center, radius_m } => {
                within("body.shape.circle.radius_m", *radius_m, 1e-3, 10.0)?;
                std::slice::from_ref(center)
            }
            BodyShape::Outline(corners) => {
                within("body.shape.outline (corners)", corners.len() as f64, 3.0, 256.0)?;
                corners.as_slice()
            }
        };
        for figure in corners.iter().flatten() {
            within("body.shape", *figure, -10.0, 10.0)?;
        }
        within("body.material.reflectance", self.material.reflectance, 0.0, 1.0)?;
        within("body.material.roughness", self.material.roughness, 0.0, 1.0)?;
        for height_m in self.z_m.iter().flatten() {
            within("body.z_m", *height_m, -1000.0, 1000.0)?;
        }
        Ok(())
    }

    /// Robot of a scene with this body.
    pub(super) fn robot(&self) -> Robot {
        let shape = match &self.shape {
            BodyShape::Circle { center, radius_m } => {
                RobotShape::Circle { center: DVec2::from_array(*center), radius_m: *radius_m }
            }
            BodyShape::Outline(corners) => {
                RobotShape::Outline(corners.iter().copied().map(DVec2::from_array).collect())
            }
        };
        Robot { id: self.id.as_str().into(), shape, material: self.material, z_m: self.z_m }
    }
}
