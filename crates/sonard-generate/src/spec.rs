//! The specification of a data set: what is drawn, from what, and what of it is kept.

mod check;
mod error;
mod read;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use sonard_model::{model::OptionKeys, plan::ScanPlan};

use crate::spread::Spread;

pub use error::SpecError;
pub(crate) use read::{Loaded, from_json, from_toml};

/// A specification as its file has it; a section that is not there has its defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// How large the set is.
    pub set: SetKeys,
    /// Kinds of scenes; each scene is of one of them.
    pub scene: Vec<SceneKeys>,
    /// Surfaces by name.
    #[serde(default = "usual_materials")]
    pub materials: BTreeMap<String, MaterialKeys>,
    /// What stands in scenes.
    #[serde(default)]
    pub furniture: FurnitureKeys,
    /// Floor and ceiling; without them scenes are plans.
    #[serde(default)]
    pub heights: Option<HeightKeys>,
    /// Where the ranger stands.
    #[serde(default)]
    pub poses: PoseKeys,
    /// Which azimuths it looks at.
    #[serde(default)]
    pub plan: PlanKeys,
    /// Which ranger it is.
    #[serde(default)]
    pub sensor: SensorKeys,
    /// The air.
    #[serde(default)]
    pub air: AirKeys,
    /// What disturbs readings.
    #[serde(default)]
    pub noise: NoiseKeys,
    /// Settings of the model, as for `sonard run`.
    #[serde(default)]
    pub model: OptionKeys,
    /// What of it all is kept.
    #[serde(default)]
    pub keep: KeepKeys,
}

/// How large a set is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetKeys {
    /// What it is called.
    pub name: String,
    /// What it is for, in a sentence.
    #[serde(default)]
    pub about: String,
    /// Another number gives another set of the same kind.
    #[serde(default)]
    pub seed: u64,
    /// Shards.
    pub shards: u32,
    /// Scenes of a shard.
    pub scenes: u32,
    /// Poses in a scene.
    pub poses: u32,
}

/// A kind of scenes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneKeys {
    /// How often, beside the weights of the others.
    #[serde(default = "one")]
    pub weight: f64,
    /// What it is like.
    pub shape: Shape,
    /// Of `file`: a shipped scene's name, or a file beside the specification.
    #[serde(default)]
    pub file: Option<String>,
    /// Along x before it is turned, metres; not of files.
    #[serde(default)]
    pub width_m: Option<Spread>,
    /// Along y, metres; not of files.
    #[serde(default)]
    pub depth_m: Option<Spread>,
    /// Of `l` and `t`: the share of width and depth that is cut away.
    #[serde(default)]
    pub notch: Option<Spread>,
    /// Of `polygon`: how many.
    #[serde(default)]
    pub corners: Option<Spread>,
    /// Turned by, degrees; not of files.
    #[serde(default)]
    pub turn_deg: Option<Spread>,
    /// Materials that each wall is of one of; all if none is named. Not of files.
    #[serde(default)]
    pub walls: Vec<String>,
}

/// What a room is like from above.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Four walls.
    Rectangle,
    /// A rectangle without one corner.
    L,
    /// A rectangle without two.
    T,
    /// Any angles.
    Polygon,
    /// The one of a file, as it is.
    File,
}

/// A surface; drawn anew for each scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialKeys {
    /// Amplitude of the mirror reflection, 0 to 1.
    pub reflectance: Spread,
    /// Share of what is not absorbed that is scattered, 0 to 1.
    #[serde(default = "zero")]
    pub roughness: Spread,
}

/// What stands in scenes that are not of files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FurnitureKeys {
    /// How many boxes.
    pub boxes: Spread,
    /// Their sides, metres.
    pub box_m: Spread,
    /// How they are turned against the room, degrees.
    pub box_turn_deg: Spread,
    /// How many cylinders.
    pub cylinders: Spread,
    /// Their radii, metres.
    pub radius_m: Spread,
    /// How many partitions, which stand out from walls.
    pub partitions: Spread,
    /// Their length, metres.
    pub partition_m: Spread,
    /// Between them and to walls at least, metres.
    pub gap_m: f64,
    /// In scenes with heights: how high boxes and cylinders are, metres.
    pub height_m: Option<Spread>,
    /// Materials that each is of one of; all if none is named.
    pub materials: Vec<String>,
}

/// Floor and ceiling.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightKeys {
    /// Height of the ceiling above the floor, metres.
    pub ceiling_m: Spread,
    /// Height of the transducer above the floor, metres.
    pub sensor_m: Spread,
    /// Materials that the floor is of one of; all if none is named.
    #[serde(default)]
    pub floor: Vec<String>,
    /// Materials that the ceiling is of one of.
    #[serde(default)]
    pub ceiling: Vec<String>,
}

/// Where the ranger stands: anywhere in a scene with its back free.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseKeys {
    /// Away from everything at least, metres.
    pub clearance_m: f64,
    /// Where azimuth 0 points, degrees counter-clockwise from +x.
    pub heading_deg: Spread,
}

/// Which azimuths a scan measures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlanKeys {
    /// First azimuth, degrees.
    pub from_deg: f64,
    /// End of the range, degrees, not itself measured.
    pub to_deg: f64,
    /// Between stops, degrees.
    pub step_deg: f64,
    /// Firings at each stop.
    pub pings_per_stop: u32,
}

/// Which ranger it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorKeys {
    /// Presets or files beside the specification; each scene has one of them.
    pub any_of: Vec<String>,
}

/// The air of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AirKeys {
    /// Degrees Celsius.
    pub temperature_c: Spread,
    /// Relative humidity, percent.
    pub humidity_percent: Spread,
    /// Kilopascals.
    pub pressure_kpa: Spread,
}

/// What disturbs the readings of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseKeys {
    /// At the receiver's input, root mean square, as the amplitude of an echo from 1 m.
    pub floor: Spread,
    /// Standard deviation of the time of flight beside that, microseconds.
    pub jitter_us: Spread,
}

/// What is kept beside status and range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct KeepKeys {
    /// Of each reading time of flight, amplitude and margin.
    pub strength: bool,
    /// The path of the echo that was heard.
    pub path: bool,
    /// Every echo of a firing down to this share of a head-on wall's, in a table of its own; 0 for none.
    pub echoes_down_to: f64,
    /// The envelope of each firing up to this range, metres; 0 for none.
    pub trace_to_m: f64,
    /// From sample to sample of it, microseconds.
    pub trace_step_us: f64,
    /// How far it is straight ahead to the nearest surface.
    pub ideal_range: bool,
    /// What was heard as a label (plane, corner, edge, ...), and a table of the planes, corners, edges and cylinders
    /// of each scene.
    pub features: bool,
    /// Side of a cell of each scene's map as it should be, metres; 0 for none.
    pub occupancy_m: f64,
}

impl Default for FurnitureKeys {
    fn default() -> Self {
        Self {
            boxes: Spread::Fixed(0.0),
            box_m: Spread::Even([0.3, 0.8]),
            box_turn_deg: Spread::Even([0.0, 90.0]),
            cylinders: Spread::Fixed(0.0),
            radius_m: Spread::Even([0.02, 0.2]),
            partitions: Spread::Fixed(0.0),
            partition_m: Spread::Even([0.5, 1.5]),
            gap_m: 0.3,
            height_m: None,
            materials: Vec::new(),
        }
    }
}

impl Default for PoseKeys {
    fn default() -> Self {
        Self { clearance_m: 0.1, heading_deg: Spread::Even([0.0, 360.0]) }
    }
}

impl Default for PlanKeys {
    fn default() -> Self {
        let ScanPlan { from_deg, to_deg, step_deg, pings_per_stop } = ScanPlan::default();
        Self { from_deg, to_deg, step_deg, pings_per_stop }
    }
}

impl From<&PlanKeys> for ScanPlan {
    fn from(keys: &PlanKeys) -> Self {
        let PlanKeys { from_deg, to_deg, step_deg, pings_per_stop } = *keys;
        Self { from_deg, to_deg, step_deg, pings_per_stop }
    }
}

impl Default for SensorKeys {
    fn default() -> Self {
        Self { any_of: vec!["senscomp-6500".to_owned()] }
    }
}

impl Default for AirKeys {
    fn default() -> Self {
        Self {
            temperature_c: Spread::Fixed(20.0),
            humidity_percent: Spread::Fixed(50.0),
            pressure_kpa: Spread::Fixed(101.325),
        }
    }
}

impl Default for NoiseKeys {
    fn default() -> Self {
        Self { floor: Spread::Fixed(0.0), jitter_us: Spread::Fixed(0.0) }
    }
}

impl Default for KeepKeys {
    fn default() -> Self {
        Self {
            strength: false,
            path: false,
            echoes_down_to: 0.0,
            trace_to_m: 0.0,
            trace_step_us: 20.0,
            ideal_range: false,
            features: false,
            occupancy_m: 0.0,
        }
    }
}

fn usual_materials() -> BTreeMap<String, MaterialKeys> {
    let plaster = MaterialKeys { reflectance: Spread::Fixed(0.97), roughness: zero() };
    [("plaster".to_owned(), plaster)].into()
}

const fn one() -> f64 {
    1.0
}

const fn zero() -> Spread {
    Spread::Fixed(0.0)
}
