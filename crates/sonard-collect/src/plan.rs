//! A plan with everything that it names.

use std::{path::PathBuf, sync::Arc};

use super::{CollectionKeys, Halt, NamedPose};
use sonard_api::{AirOrder, config::Layers};
use sonard_device::ranger::{Motion, ScanInputs};
use sonard_model::{
    acoustics::{Air, Sensor},
    scene::Scene,
};
use sonard_records::ScanPlan;

/// What a plan may say about the air.
const AIR: [&str; 4] = ["temperature_c", "humidity_percent", "pressure_kpa", "file"];

/// A source of poses.
#[derive(Debug, Clone, PartialEq)]
pub enum Poses {
    /// They are all known.
    Listed(Vec<NamedPose>),
    /// A person gives them.
    Prompt,
    /// A command that is run for each.
    Program(String),
    /// A command that prints them one by one.
    Stream(String),
}

/// A plan with everything it names.
#[derive(Debug)]
pub struct Plan {
    /// Every key in force.
    pub keys: CollectionKeys,
    /// The plan's text.
    pub text: String,
    /// Where the collection goes.
    pub folder: PathBuf,
    /// The scene.
    pub scene: Arc<Scene>,
    /// Its text.
    pub scene_text: String,
    /// The sensor, as the plan changes it.
    pub sensor: Sensor,
    /// Where the ranger is to stand.
    pub poses: Poses,
    /// Which azimuths.
    pub azimuths: ScanPlan,
    /// Motor steps a turn.
    pub steps_per_revolution: u16,
    /// Where the keys were given.
    pub layers: Layers<CollectionKeys>,
    /// The plan's file, as errors call it.
    pub name: String,
}

impl Plan {
    /// What is measured at a pose in this air.
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
            // Options that the engine does not know are refused when the plan is read.
            options: self.keys.sensor.options.options_of_engine(),
        }
    }

    /// The air at this temperature, degrees Celsius.
    ///
    /// # Errors
    /// When there is no such air.
    pub fn air(&self, temperature_c: f64) -> Result<Air, Halt> {
        let keys = &self.keys.air;
        Air::new(temperature_c, keys.humidity_percent, keys.pressure_kpa)
            .map_err(|error| Halt::failed(error, "degrees Celsius, percent and kilopascals"))
    }

    /// How the motor turns and the ranger listens.
    #[must_use]
    pub fn motion(&self) -> Motion {
        Motion::from(&self.keys.motion)
    }

    /// Poses that will be there, as far as that is known.
    #[must_use]
    pub fn pose_count(&self) -> Option<u32> {
        match &self.poses {
            Poses::Listed(poses) => Some(poses.len() as u32),
            _ => Some(self.keys.poses.count).filter(|&count| count > 0),
        }
    }

    /// Whether the plan says anything about the air.
    #[must_use]
    pub fn gives_air(&self) -> bool {
        self.given_air().next().is_some()
    }

    /// What a daemon is told about the air; nothing if that is the daemon's to know.
    #[must_use]
    pub fn air_order(&self, temperature_c: f64) -> Option<AirOrder> {
        let given = |key, value| self.is_given("air", key).then_some(value);
        self.gives_air().then(|| AirOrder {
            temperature_c,
            humidity_percent: given("humidity_percent", self.keys.air.humidity_percent),
            pressure_kpa: given("pressure_kpa", self.keys.air.pressure_kpa),
        })
    }

    /// What it says about it.
    pub fn given_air(&self) -> impl Iterator<Item = &'static str> {
        AIR.into_iter().filter(|key| self.is_given("air", key))
    }

    /// Whether a key stands in the plan, or was set over it.
    #[must_use]
    pub fn is_given(&self, section: &str, key: &str) -> bool {
        self.layers.origin(section, key).is_some()
    }
}
