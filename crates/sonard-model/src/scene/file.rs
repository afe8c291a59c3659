//! The scene file as it is written: shapes only, nothing checked yet.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use super::Material;
use crate::geometry::Pose;

/// A point of the floor plan, `[x, y]` in metres: x to the right, y up.
pub(super) type Point = [f64; 2];

/// A floor plan with the materials of its surfaces, for the model of an ultrasonic ranger.
///
/// World frame: x to the right, y up, metres; angles in degrees counter-clockwise from +x.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
#[schemars(title = "sonard scene")]
pub(super) struct SceneFile {
    /// Address of this schema, for editors. Not used otherwise.
    #[serde(rename = "$schema", default)]
    pub(super) _schema: Option<String>,
    /// The scene's name.
    #[schemars(length(min = 1))]
    pub(super) name: String,
    /// Where its dimensions come from: paper and figure, or who measured them.
    #[serde(default)]
    pub(super) source: Option<String>,
    /// What in it is approximate or assumed, one sentence each.
    #[serde(default)]
    pub(super) approximate: Vec<String>,
    /// Surfaces by name; walls and cylinders refer to them.
    pub(super) materials: BTreeMap<String, Material>,
    /// Flat reflectors. Both faces reflect.
    #[serde(default)]
    pub(super) walls: Vec<WallFile>,
    /// Upright circular reflectors.
    #[serde(default)]
    pub(super) cylinders: Vec<CylinderFile>,
    /// Height of the floor, metres. Leave it out for a scene in the plane.
    #[serde(default)]
    pub(super) floor_z_m: Option<f64>,
    /// Name of the floor's material. Without it the floor is a perfect mirror.
    #[serde(default)]
    pub(super) floor_material: Option<String>,
    /// Height of the ceiling, metres; above `floor_z_m`.
    #[serde(default)]
    pub(super) ceiling_z_m: Option<f64>,
    /// Name of the ceiling's material. Without it the ceiling is a perfect mirror.
    #[serde(default)]
    pub(super) ceiling_material: Option<String>,
    /// What is drawn closer together than this was meant to meet, metres (0.002 without it): corners that gape
    /// are closed, walls that stop short of another or run past it end on it, and walls drawn over each other
    /// are one. 0 takes the plan as it is drawn.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.005))]
    pub(super) snap_m: Option<f64>,
    /// Named poses of the ranger: where its rotation axis stands and where azimuth 0 points.
    #[serde(default)]
    pub(super) poses: BTreeMap<String, Pose>,
    /// The body of the robot that carries the ranger.
    #[serde(default)]
    pub(super) robot: Option<RobotFile>,
}

/// One wall, `from` one point `to` another, or several as a `polyline`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
#[schemars(transform = super::schema::one_shape_of_wall)]
pub(super) struct WallFile {
    /// Its name, used in records; the segments of a polyline are `id.0`, `id.1`, ...
    #[schemars(length(min = 1))]
    pub(super) id: String,
    /// One end of a single wall.
    #[serde(default)]
    pub(super) from: Option<Point>,
    /// The other end of a single wall.
    #[serde(default)]
    pub(super) to: Option<Point>,
    /// Corners of a row of walls, at least two.
    #[serde(default)]
    #[schemars(length(min = 2))]
    pub(super) polyline: Option<Vec<Point>>,
    /// Whether a last wall joins the polyline's end to its beginning.
    #[serde(default)]
    pub(super) closed: bool,
    /// Name of its material.
    pub(super) material: String,
    /// From and to what height it stands, metres. Without it: floor to ceiling.
    #[serde(default)]
    pub(super) z_m: Option<[f64; 2]>,
}

/// An upright circular reflector: a pillar, a table leg, a bottle.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
pub(super) struct CylinderFile {
    /// Its name, used in records.
    #[schemars(length(min = 1))]
    pub(super) id: String,
    /// Its axis, `[x, y]` in metres.
    pub(super) center: Point,
    /// Its radius, metres.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub(super) radius_m: f64,
    /// Name of its material.
    pub(super) material: String,
    /// From and to what height it stands, metres. Without it: floor to ceiling.
    #[serde(default)]
    pub(super) z_m: Option<[f64; 2]>,
}

/// The body of a robot, in a frame that moves and turns with the pose: its origin is the
/// ranger's rotation axis, its x axis points along the heading, its y axis to the left of it.
/// Either a `circle` or an `outline`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
#[schemars(transform = super::schema::one_shape_of_robot)]
pub(super) struct RobotFile {
    /// Its name, used in records.
    #[schemars(length(min = 1))]
    pub(super) id: String,
    /// A round body.
    #[serde(default)]
    pub(super) circle: Option<CircleFile>,
    /// Corners of a body with flat sides, at least three; the last is joined to the first.
    #[serde(default)]
    #[schemars(length(min = 3))]
    pub(super) outline: Option<Vec<Point>>,
    /// Name of its material.
    pub(super) material: String,
    /// From and to what height it stands, metres. Without it: floor to ceiling.
    #[serde(default)]
    pub(super) z_m: Option<[f64; 2]>,
}

/// A circle in the robot's frame.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object { ... }")]
pub(super) struct CircleFile {
    /// Its centre, `[ahead, left]` in metres from the ranger's rotation axis.
    pub(super) center: Point,
    /// Its radius, metres.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub(super) radius_m: f64,
}
