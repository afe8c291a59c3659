//! Structure of a scene file, before validation.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use super::Material;
use crate::geometry::Pose;

/// Point of the floor plan, `[x, y]` in metres: x to the right, y up.
pub(super) type Point = [f64; 2];

/// Floor plan with surface materials, for the model of an ultrasonic ranger.
///
/// World frame: x to the right, y up, metres; angles in degrees counter-clockwise from +x.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
#[schemars(title = "sonard scene")]
pub(super) struct SceneFile {
    /// Address of this schema, for editors. Ignored otherwise.
    #[serde(rename = "$schema", default)]
    pub(super) _schema: Option<String>,
    /// Scene name, not empty.
    #[schemars(length(min = 1))]
    pub(super) name: String,
    /// Source of the dimensions: paper and figure, or who measured them.
    #[serde(default)]
    pub(super) source: Option<String>,
    /// Approximations and assumptions, one sentence each.
    #[serde(default)]
    pub(super) approximate: Vec<String>,
    /// Surfaces by name; walls and cylinders refer to them.
    pub(super) materials: BTreeMap<String, Material>,
    /// Flat reflectors. Both faces reflect.
    #[serde(default)]
    pub(super) walls: Vec<WallFile>,
    /// Upright circular reflectors: pillars, table legs.
    #[serde(default)]
    pub(super) cylinders: Vec<CylinderFile>,
    /// Height of the floor, metres. Omit it for a scene in the plane.
    #[serde(default)]
    pub(super) floor_z_m: Option<f64>,
    /// Name of the floor's material. Default: a perfect mirror.
    #[serde(default)]
    pub(super) floor_material: Option<String>,
    /// Height of the ceiling, metres; above `floor_z_m`.
    #[serde(default)]
    pub(super) ceiling_z_m: Option<f64>,
    /// Name of the ceiling's material. Default: a perfect mirror.
    #[serde(default)]
    pub(super) ceiling_material: Option<String>,
    /// Snap tolerance, metres (default 0.002): open corners within the tolerance are closed, walls
    /// that stop short of another or run past it end on it, and overlapping walls are merged. 0
    /// keeps the plan as drawn.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.005))]
    pub(super) snap_m: Option<f64>,
    /// Named poses of the ranger: position of its rotation axis and direction of azimuth 0.
    #[serde(default)]
    pub(super) poses: BTreeMap<String, Pose>,
    /// Body of the robot that carries the ranger.
    #[serde(default)]
    pub(super) robot: Option<RobotFile>,
}

/// Single wall from `from` to `to`, or several as a `polyline`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
#[schemars(transform = super::schema::one_shape_of_wall)]
pub(super) struct WallFile {
    /// Identifier in records; the segments of a polyline are `id.0`, `id.1`, ...
    #[schemars(length(min = 1))]
    pub(super) id: String,
    /// First end of a single wall.
    #[serde(default)]
    pub(super) from: Option<Point>,
    /// Second end of a single wall.
    #[serde(default)]
    pub(super) to: Option<Point>,
    /// Corners of a row of walls, at least two.
    #[serde(default)]
    #[schemars(length(min = 2))]
    pub(super) polyline: Option<Vec<Point>>,
    /// Adds a last wall from the end of the polyline to its beginning.
    #[serde(default)]
    pub(super) closed: bool,
    /// Name of the wall's material.
    pub(super) material: String,
    /// Lower and upper height, metres. Default: floor to ceiling.
    #[serde(default)]
    pub(super) z_m: Option<[f64; 2]>,
}

/// Upright circular reflector: a pillar, a table leg, a bottle.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
pub(super) struct CylinderFile {
    /// Identifier of the reflector in records.
    #[schemars(length(min = 1))]
    pub(super) id: String,
    /// Position of the axis, `[x, y]` in metres.
    pub(super) center: Point,
    /// Radius of the cylinder, metres.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub(super) radius_m: f64,
    /// Name of the cylinder's material.
    pub(super) material: String,
    /// Lower and upper height, metres. Default: floor to ceiling.
    #[serde(default)]
    pub(super) z_m: Option<[f64; 2]>,
}

/// Body of a robot, in the robot's frame: the origin is the ranger's rotation axis, x points along
/// the heading, y to the left. Either a `circle` or an `outline`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
#[schemars(transform = super::schema::one_shape_of_robot)]
pub(super) struct RobotFile {
    /// Identifier of the reflector in records.
    #[schemars(length(min = 1))]
    pub(super) id: String,
    /// Circular outline of the body.
    #[serde(default)]
    pub(super) circle: Option<CircleFile>,
    /// Corners of a polygonal body, at least three; implicitly closed.
    #[serde(default)]
    #[schemars(length(min = 3))]
    pub(super) outline: Option<Vec<Point>>,
    /// Name of the body's material.
    pub(super) material: String,
    /// Lower and upper height, metres. Default: floor to ceiling.
    #[serde(default)]
    pub(super) z_m: Option<[f64; 2]>,
}

/// Circle in the robot's frame.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
pub(super) struct CircleFile {
    /// Centre, `[forward, left]` in metres from the ranger's rotation axis.
    pub(super) center: Point,
    /// Radius of the circle, metres.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub(super) radius_m: f64,
}
