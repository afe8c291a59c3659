//! Scenes: walls and cylinders of some material, and named poses.

use std::{collections::BTreeMap, sync::Arc};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::{DVec2, Pose};

/// A checked scene: every wall has a length, every material is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The scene's name.
    pub name: String,
    /// Where its dimensions come from.
    pub source: Option<String>,
    /// What in it is approximate, one sentence each.
    pub approximate: Vec<String>,
    /// Flat reflectors, one segment each.
    pub walls: Vec<Wall>,
    /// Upright circular reflectors.
    pub cylinders: Vec<Cylinder>,
    /// Height of the floor, metres; `None` for a scene in the plane.
    pub floor_z_m: Option<f64>,
    /// Height of the ceiling, metres.
    pub ceiling_z_m: Option<f64>,
    /// Named poses of the ranger.
    pub poses: BTreeMap<String, Pose>,
    /// SHA-256 of the text it was read from, hexadecimal.
    pub sha256: String,
}

/// How a surface treats sound.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Amplitude of the mirror reflection relative to the incident wave, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub reflectance: f64,
    /// Share of what is not absorbed that is scattered instead of mirrored, 0 to 1.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub roughness: f64,
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
