//! Resolved collection plan: keys with the loaded scene, sensor and poses.

use std::{path::PathBuf, sync::Arc};

use super::{CollectError, CollectionKeys, NamedPose};
use sonard_api::{AirOrder, config::ConfigLayers};
use sonard_device::ranger::{Motion, ScanInputs};
use sonard_model::{
    acoustics::{Air, Sensor},
    scene::Scene,
};
use sonard_records::ScanPlan;

/// Keys of the plan's `[air]` section.
const AIR_KEYS: [&str; 4] = ["temperature_c", "humidity_percent", "pressure_kpa", "file"];

/// Source of a collection's poses.
#[derive(Debug, Clone, PartialEq)]
pub enum Poses {
    /// Poses listed in the plan or in a file.
    Listed(Vec<NamedPose>),
    /// Poses entered by the operator.
    Prompt,
    /// Command that is run once per pose.
    Program(String),
    /// Command that prints one pose per line.
    Stream(String),
}

/// Collection plan with its loaded inputs.
#[derive(Debug)]
pub struct CollectionPlan {
    /// Effective values of all keys.
    pub keys: CollectionKeys,
    /// Text of the plan's file.
    pub text: String,
    /// Folder of the collection.
    pub folder: PathBuf,
    /// Loaded scene.
    pub scene: Arc<Scene>,
    /// Text of the scene's file.
    pub scene_text: String,
    /// Sensor with the plan's overrides.
    pub sensor: Sensor,
    /// Poses of the ranger.
    pub poses: Poses,
    /// Azimuths of the beams.
    pub azimuths: ScanPlan,
    /// Motor steps per revolution.
    pub steps_per_revolution: u16,
    /// Layers of the configuration, with the origin of each key.
    pub layers: ConfigLayers<CollectionKeys>,
    /// Name of the plan's file in error messages.
    pub name: String,
}

impl CollectionPlan {
    /// Builds the inputs of a scan at a pose in the given air.
    #[must_use]
    pub fn inputs(&self, pose: &NamedPose, air: Air) -> ScanInputs {
        ScanInputs {
            scene: Arc::clone(&self.scene),
            pose: pose.pose,
            pose_text: pose.label(),
            plan: self.azimuths,
            motion: self.motion(),
            sensor: self.sensor.clone(),
            air,
            // Options that the engine does not support are rejected when the plan is read.
            options: self.keys.sensor.options.engine_options(),
        }
    }

    /// Returns the air at a temperature in degrees Celsius, with the plan's humidity and pressure.
    ///
    /// # Errors
    /// Returns an error if a value is outside the valid range.
    pub fn air(&self, temperature_c: f64) -> Result<Air, CollectError> {
        let keys = &self.keys.air;
        Air::new(temperature_c, keys.humidity_percent, keys.pressure_kpa).map_err(|error| {
            CollectError::failed(error, "degrees Celsius, percent and kilopascals")
        })
    }

    /// Motion and measurement settings.
    #[must_use]
    pub fn motion(&self) -> Motion {
        Motion::from(&self.keys.motion)
    }

    /// Returns the number of poses; `None` for a source without limit.
    #[must_use]
    pub fn pose_count(&self) -> Option<u32> {
        match &self.poses {
            Poses::Listed(poses) => Some(poses.len() as u32),
            _ => Some(self.keys.poses.count).filter(|&count| count > 0),
        }
    }

    /// Returns `true` if the plan sets any key of `[air]`.
    #[must_use]
    pub fn sets_air(&self) -> bool {
        self.air_keys().next().is_some()
    }

    /// Returns the air settings for a daemon; `None` if the plan leaves them to the daemon.
    #[must_use]
    pub fn air_order(&self, temperature_c: f64) -> Option<AirOrder> {
        let given = |key, value| self.is_set("air", key).then_some(value);
        self.sets_air().then(|| AirOrder {
            temperature_c,
            humidity_percent: given("humidity_percent", self.keys.air.humidity_percent),
            pressure_kpa: given("pressure_kpa", self.keys.air.pressure_kpa),
        })
    }

    /// Lists the keys of `[air]` that the plan sets.
    pub fn air_keys(&self) -> impl Iterator<Item = &'static str> {
        AIR_KEYS.into_iter().filter(|key| self.is_set("air", key))
    }

    /// Returns `true` if a key is set in the plan or by an override.
    #[must_use]
    pub fn is_set(&self, section: &str, key: &str) -> bool {
        self.layers.origin(section, key).is_some()
    }
}
