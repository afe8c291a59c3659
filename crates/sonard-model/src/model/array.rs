//! Readings of the rangers of an array.

use std::sync::Arc;

use rand::Rng;

use super::{ModelError, Options, Prediction, Simulator, TooCostly};
use crate::{
    acoustics::{Air, ReceiverNoise, Sensor},
    array::RangerArray,
    geometry::Pose,
    scene::Scene,
};

/// Predicts what the rangers of an array read, each from its own place on the robot.
///
/// A robot's body, the array's or the scene's, turns and moves with the robot, so that it needs
/// another model for each pose; without one, poses share it. Rangers of different heights have a model
/// each.
pub struct ArrayModel {
    array: Arc<RangerArray>,
    scene: Arc<Scene>,
    sensor: Sensor,
    air: Air,
    options: Options,
    /// Of a scene without a robot's body, one for each entry of `heights`.
    simulators: Vec<Simulator>,
    /// The heights that rangers have, each once.
    heights: Vec<Option<f64>>,
}

/// An array at a pose.
pub struct ArrayAtPose<'a> {
    model: &'a ArrayModel,
    pose: Pose,
    /// With the body among the reflectors, where there is one.
    own: Vec<Simulator>,
}

impl ArrayModel {
    /// For an array of rangers of one kind in a scene. A ranger listens until the next one fires,
    /// so ranges end where sound needs longer than that.
    ///
    /// # Errors
    /// When the sensor's data or an option are out of range.
    pub fn new(
        array: Arc<RangerArray>,
        scene: &Scene,
        sensor: Sensor,
        air: Air,
        options: Options,
    ) -> Result<Self, ModelError> {
        let wanted_m = options.max_range_m.unwrap_or(sensor.max_range_m);
        let heard_m = air.sound_speed_m_s() * array.interval_ms * 1e-3 / 2.0;
        let options = Options { max_range_m: Some(wanted_m.min(heard_m)), ..options };
        let mut heights: Vec<Option<f64>> = Vec::new();
        for ranger in &array.rangers {
            if !heights.contains(&ranger.z_m) {
                heights.push(ranger.z_m);
            }
        }
        let scene = Arc::new(array.in_scene(scene));
        let mut model =
            Self { array, scene, sensor, air, options, simulators: Vec::new(), heights };
        model.simulators = model.simulators_in(&model.scene)?;
        Ok(model)
    }

    /// The array at a pose.
    ///
    /// # Errors
    /// Never with a model that could be made.
    pub fn at(&self, pose: Pose) -> Result<ArrayAtPose<'_>, ModelError> {
        let own = match self.scene.robot {
            Some(_) => self.simulators_in(&Arc::new(self.scene.with_robot_at(&pose)))?,
            None => Vec::new(),
        };
        Ok(ArrayAtPose { model: self, pose, own })
    }

    /// The array.
    #[must_use]
    pub const fn array(&self) -> &Arc<RangerArray> {
        &self.array
    }

    /// The scene, with the robot's body apart.
    #[must_use]
    pub const fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// A model of one of its rangers: sensor, air, settings and records are those of all.
    #[must_use]
    pub fn simulator(&self) -> &Simulator {
        &self.simulators[0]
    }

    fn simulators_in(&self, scene: &Arc<Scene>) -> Result<Vec<Simulator>, ModelError> {
        let simulator = |z_m: &Option<f64>| {
            let mut sensor = self.sensor.clone();
            sensor.mounting.z_m = z_m.or(sensor.mounting.z_m);
            Simulator::new(Arc::clone(scene), sensor, self.air, self.options)
        };
        self.heights.iter().map(simulator).collect()
    }
}

impl ArrayAtPose<'_> {
    /// The array.
    #[must_use]
    pub fn array(&self) -> &RangerArray {
        &self.model.array
    }

    /// The robot's pose.
    #[must_use]
    pub const fn pose(&self) -> &Pose {
        &self.pose
    }

    /// The reading of a ranger, by its index in the array.
    ///
    /// # Errors
    /// When there are more paths than can be found within bounds of work and memory.
    pub fn ping(&self, ranger: usize) -> Result<Prediction, TooCostly> {
        let (simulator, pose) = self.mounted(ranger);
        simulator.at(pose.position()).ping(pose.direction_rad(0.0))
    }

    /// The same in noise: the same generator in the same state gives the same reading.
    ///
    /// # Errors
    /// As [`Self::ping`].
    pub fn ping_in_noise(
        &self,
        ranger: usize,
        noise: &ReceiverNoise,
        rng: &mut impl Rng,
    ) -> Result<Prediction, TooCostly> {
        let (simulator, pose) = self.mounted(ranger);
        simulator.at(pose.position()).ping_in_noise(pose.direction_rad(0.0), noise, rng)
    }

    /// The model that a ranger's predictions are to be put into words with.
    #[must_use]
    pub fn simulator(&self, ranger: usize) -> &Simulator {
        self.mounted(ranger).0
    }

    fn mounted(&self, ranger: usize) -> (&Simulator, Pose) {
        let mounted = &self.model.array.rangers[ranger];
        let height = self.model.heights.iter().position(|z_m| *z_m == mounted.z_m).unwrap_or(0);
        let simulators = if self.own.is_empty() { &self.model.simulators } else { &self.own };
        (&simulators[height], mounted.pose_on(&self.pose))
    }
}
