//! Specification of a data set: distributions of scenes, sensors and noise, and the recorded
//! columns.

mod check;
mod error;
mod read;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use sonard_model::{model::OptionKeys, scan_plan::ScanPlan};

use crate::distribution::NumberDistribution;

pub use error::SpecError;
pub(crate) use read::{LoadedSpec, from_json, from_toml};

/// Specification as in its file; missing sections have defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Size of the set.
    pub set: SetKeys,
    /// Kinds of scenes, of which each scene is one.
    pub scene: Vec<SpecSceneKeys>,
    /// Surface materials by name.
    #[serde(default = "default_materials")]
    pub materials: BTreeMap<String, MaterialKeys>,
    /// Furniture of generated scenes.
    #[serde(default)]
    pub furniture: FurnitureKeys,
    /// Floor and ceiling; scenes without them are plans.
    #[serde(default)]
    pub heights: Option<HeightKeys>,
    /// Poses of the ranger.
    #[serde(default)]
    pub poses: PoseKeys,
    /// Azimuths of a scan.
    #[serde(default)]
    pub plan: SpecPlanKeys,
    /// Sensors of the rangers.
    #[serde(default)]
    pub sensor: SpecSensorKeys,
    /// Distributions of the air.
    #[serde(default)]
    pub air: AirKeys,
    /// Distributions of receiver noise.
    #[serde(default)]
    pub noise: NoiseKeys,
    /// Model settings, as for `sonard run`.
    #[serde(default)]
    pub model: OptionKeys,
    /// Recorded tables and columns.
    #[serde(default)]
    pub keep: KeepKeys,
}

/// Size and identity of a set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetKeys {
    /// Name of the set.
    pub name: String,
    /// Purpose of the set, in a sentence.
    #[serde(default)]
    pub about: String,
    /// Seed; different seeds give different sets.
    #[serde(default)]
    pub seed: u64,
    /// Number of shards in the set.
    pub shards: u32,
    /// Number of scenes per shard.
    pub scenes: u32,
    /// Number of poses per scene.
    pub poses: u32,
}

/// Kind of scenes, with the distributions of its rooms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecSceneKeys {
    /// Relative frequency of this kind.
    #[serde(default = "default_weight")]
    pub weight: f64,
    /// Shape of the room.
    pub shape: RoomShape,
    /// Shipped scene, or file next to the specification; only for shape `file`.
    #[serde(default)]
    pub file: Option<String>,
    /// Extent along x before rotation, metres; not for shape `file`.
    #[serde(default)]
    pub width_m: Option<NumberDistribution>,
    /// Extent along y before rotation, metres; not for shape `file`.
    #[serde(default)]
    pub depth_m: Option<NumberDistribution>,
    /// Share of width and depth that is cut away; only for shapes `l` and `t`.
    #[serde(default)]
    pub notch: Option<NumberDistribution>,
    /// Number of corners; only for shape `polygon`.
    #[serde(default)]
    pub corners: Option<NumberDistribution>,
    /// Rotation, degrees; not for shape `file`.
    #[serde(default)]
    pub turn_deg: Option<NumberDistribution>,
    /// Materials of the walls, one drawn for each wall; all materials if empty. Not for shape
    /// `file`.
    #[serde(default)]
    pub walls: Vec<String>,
}

/// Shape of a room seen from above.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RoomShape {
    /// Rectangle with four walls.
    Rectangle,
    /// Rectangle without one corner.
    L,
    /// Rectangle without two corners.
    T,
    /// Polygon with arbitrary angles.
    Polygon,
    /// Unmodified scene of a file.
    File,
}

/// Surface material, drawn for each scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialKeys {
    /// Amplitude of the specular reflection, 0 to 1.
    pub reflectance: NumberDistribution,
    /// Scattered share of the energy that is not absorbed, 0 to 1.
    #[serde(default = "zero")]
    pub roughness: NumberDistribution,
}

/// Furniture of generated scenes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FurnitureKeys {
    /// Number of boxes per scene.
    pub boxes: NumberDistribution,
    /// Side length of a box, metres.
    pub box_m: NumberDistribution,
    /// Rotation of a box relative to the room, degrees.
    pub box_turn_deg: NumberDistribution,
    /// Number of cylinders per scene.
    pub cylinders: NumberDistribution,
    /// Radius of a cylinder, metres.
    pub radius_m: NumberDistribution,
    /// Number of partitions, which extend from walls.
    pub partitions: NumberDistribution,
    /// Length of a partition, metres.
    pub partition_m: NumberDistribution,
    /// Minimum gap between pieces and to walls, metres.
    pub gap_m: f64,
    /// Height of boxes and cylinders, metres; only in scenes with heights.
    pub height_m: Option<NumberDistribution>,
    /// Materials of the furniture, one drawn for each piece; all materials if empty.
    pub materials: Vec<String>,
}

/// Floor and ceiling of generated scenes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightKeys {
    /// Height of the ceiling above the floor, metres.
    pub ceiling_m: NumberDistribution,
    /// Height of the transducer above the floor, metres.
    pub sensor_m: NumberDistribution,
    /// Materials of the floor, one drawn for each scene; all materials if empty.
    #[serde(default)]
    pub floor: Vec<String>,
    /// Materials of the ceiling, one drawn for each scene; all materials if empty.
    #[serde(default)]
    pub ceiling: Vec<String>,
}

/// Poses of the ranger, uniform over the free space of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseKeys {
    /// Minimum distance to all surfaces, metres.
    pub clearance_m: f64,
    /// Direction of azimuth 0, degrees counter-clockwise from +x.
    pub heading_deg: NumberDistribution,
}

/// Azimuths of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SpecPlanKeys {
    /// First azimuth of the scan, degrees.
    pub from_deg: f64,
    /// End of the range, exclusive, degrees.
    pub to_deg: f64,
    /// Step between stops, degrees.
    pub step_deg: f64,
    /// Number of firings at each stop.
    pub pings_per_stop: u32,
}

/// Sensors of the rangers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SpecSensorKeys {
    /// Presets, or files next to the specification; one is drawn for each scene.
    pub any_of: Vec<String>,
}

/// Distributions of the air of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AirKeys {
    /// Temperature of the air, degrees Celsius.
    pub temperature_c: NumberDistribution,
    /// Relative humidity of the air, percent.
    pub humidity_percent: NumberDistribution,
    /// Static pressure of the air, kilopascals.
    pub pressure_kpa: NumberDistribution,
}

/// Distributions of the noise of a scene's readings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseKeys {
    /// RMS noise at the receiver's input, as the amplitude of an echo from 1 m.
    pub floor: NumberDistribution,
    /// Standard deviation of additional jitter of the time of flight, microseconds.
    pub jitter_us: NumberDistribution,
}

/// Recorded columns and tables in addition to status and range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct KeepKeys {
    /// Time of flight, amplitude and margin of each reading.
    pub strength: bool,
    /// Propagation path of the detected echo.
    pub path: bool,
    /// Minimum amplitude, relative to a head-on wall, of the echoes in a table of all echoes; 0 for
    /// none.
    pub min_echo_amplitude: f64,
    /// Maximum range of recorded envelopes, metres; 0 for none.
    pub envelope_range_m: f64,
    /// Sample interval of envelopes, microseconds.
    pub envelope_step_us: f64,
    /// Distance along the beam axis to the nearest surface.
    pub ideal_range: bool,
    /// Feature label of the detected echo (plane, corner, edge, ...), and a table of the planes,
    /// corners, edges and cylinders of each scene.
    pub features: bool,
    /// Cell size of the true occupancy map of each scene, metres; 0 for none.
    pub occupancy_m: f64,
}

impl Default for FurnitureKeys {
    fn default() -> Self {
        Self {
            boxes: NumberDistribution::Fixed(0.0),
            box_m: NumberDistribution::Uniform([0.3, 0.8]),
            box_turn_deg: NumberDistribution::Uniform([0.0, 90.0]),
            cylinders: NumberDistribution::Fixed(0.0),
            radius_m: NumberDistribution::Uniform([0.02, 0.2]),
            partitions: NumberDistribution::Fixed(0.0),
            partition_m: NumberDistribution::Uniform([0.5, 1.5]),
            gap_m: 0.3,
            height_m: None,
            materials: Vec::new(),
        }
    }
}

impl Default for PoseKeys {
    fn default() -> Self {
        Self { clearance_m: 0.1, heading_deg: NumberDistribution::Uniform([0.0, 360.0]) }
    }
}

impl Default for SpecPlanKeys {
    fn default() -> Self {
        let ScanPlan { from_deg, to_deg, step_deg, pings_per_stop } = ScanPlan::default();
        Self { from_deg, to_deg, step_deg, pings_per_stop }
    }
}

impl From<&SpecPlanKeys> for ScanPlan {
    fn from(keys: &SpecPlanKeys) -> Self {
        let SpecPlanKeys { from_deg, to_deg, step_deg, pings_per_stop } = *keys;
        Self { from_deg, to_deg, step_deg, pings_per_stop }
    }
}

impl Default for SpecSensorKeys {
    fn default() -> Self {
        Self { any_of: vec!["senscomp-6500".to_owned()] }
    }
}

impl Default for AirKeys {
    fn default() -> Self {
        Self {
            temperature_c: NumberDistribution::Fixed(20.0),
            humidity_percent: NumberDistribution::Fixed(50.0),
            pressure_kpa: NumberDistribution::Fixed(101.325),
        }
    }
}

impl Default for NoiseKeys {
    fn default() -> Self {
        Self { floor: NumberDistribution::Fixed(0.0), jitter_us: NumberDistribution::Fixed(0.0) }
    }
}

impl Default for KeepKeys {
    fn default() -> Self {
        Self {
            strength: false,
            path: false,
            min_echo_amplitude: 0.0,
            envelope_range_m: 0.0,
            envelope_step_us: 20.0,
            ideal_range: false,
            features: false,
            occupancy_m: 0.0,
        }
    }
}

fn default_materials() -> BTreeMap<String, MaterialKeys> {
    let plaster = MaterialKeys { reflectance: NumberDistribution::Fixed(0.97), roughness: zero() };
    [("plaster".to_owned(), plaster)].into()
}

const fn default_weight() -> f64 {
    1.0
}

const fn zero() -> NumberDistribution {
    NumberDistribution::Fixed(0.0)
}
