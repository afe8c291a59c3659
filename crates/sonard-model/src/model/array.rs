//! Readings of the rangers of an array.

use std::sync::Arc;

use rand::Rng;

use super::{
    ModelError, Options, Prediction, Simulator, TooCostly,
    crosstalk::{OtherFirings, crosstalk_slots},
    paths::{PathEngine, TransducerPose},
};
use crate::{
    acoustics::{Air, Mounting, ReceiverNoise, Sensor},
    array::RangerArray,
    geometry::Pose,
    scene::Scene,
};

/// Model of an array: predicts the reading of each ranger from its own place on the robot.
///
/// A robot's body, the array's or the scene's, turns and moves with the robot, so it needs a
/// separate model for each pose; without one, poses share a model. Rangers at different heights
/// have a model each.
///
/// # Crosstalk
///
/// In a round ([`ArrayAtPose::ping_in_round`]) a ranger also receives the sound of those that fire
/// in the same slot and in earlier slots, as far back as a perfect wall's echo could pass the
/// threshold. This requires the engine `paths`, and is disabled by
/// [`PathOptions::without_crosstalk`](super::PathOptions::without_crosstalk). The robot is assumed
/// to be stationary meanwhile, and another ranger's sound to leave at the height of the receiving
/// one. Scattering by rough walls from one ranger to another is omitted.
pub struct ArrayModel {
    array: Arc<RangerArray>,
    scene: Arc<Scene>,
    /// Models of the scene without a robot's body.
    bare: ArrayModels,
    /// Distinct heights of the rangers.
    heights: Vec<Option<f64>>,
}

/// Models of a scene, one for rangers at each of the heights.
struct ArrayModels {
    simulators: Vec<Simulator>,
    crosstalk: Option<Crosstalk>,
}

struct Crosstalk {
    /// Number of earlier slots that are included.
    slots_back: usize,
    /// Engines for paths of that length, at each height.
    engines: Vec<PathEngine>,
}

/// An array at a pose.
pub struct ArrayAtPose<'a> {
    model: &'a ArrayModel,
    pose: Pose,
    /// Models with the body among the reflectors, if there is one.
    own: Option<ArrayModels>,
}

impl ArrayModel {
    /// Creates the model of an array of rangers of one kind in a scene. A ranger receives until the
    /// next one fires, so the maximum range is limited by that interval.
    ///
    /// # Errors
    /// When the sensor's data or an option are out of range.
    pub fn new(
        array: Arc<RangerArray>,
        scene: &Scene,
        sensor: &Sensor,
        air: Air,
        options: Options,
    ) -> Result<Self, ModelError> {
        let requested_m = options.max_range_m.unwrap_or(sensor.max_range_m);
        let interval_m = air.sound_speed_m_s() * array.interval_ms * 1e-3 / 2.0;
        let options = Options { max_range_m: Some(requested_m.min(interval_m)), ..options };
        let mut heights: Vec<Option<f64>> = Vec::new();
        for ranger in &array.rangers {
            if !heights.contains(&ranger.z_m) {
                heights.push(ranger.z_m);
            }
        }
        let scene = Arc::new(array.scene_with_body(scene));
        let simulator = |z_m: &Option<f64>| {
            let mounting = Mounting { z_m: z_m.or(sensor.mounting.z_m), ..sensor.mounting };
            Simulator::new(Arc::clone(&scene), Sensor { mounting, ..sensor.clone() }, air, options)
        };
        let simulators = heights.iter().map(simulator).collect::<Result<_, _>>()?;
        let bare = ArrayModels::new(&array, simulators);
        Ok(Self { array, scene, bare, heights })
    }

    /// Returns the array at a pose.
    ///
    /// # Errors
    /// Never for a model that was created successfully.
    pub fn at(&self, pose: Pose) -> Result<ArrayAtPose<'_>, ModelError> {
        let mut own = None;
        if self.scene.robot.is_some() {
            let scene = Arc::new(self.scene.with_robot_at(&pose));
            let around = |simulator: &Simulator| simulator.in_scene(Arc::clone(&scene));
            let simulators = self.bare.simulators.iter().map(around).collect::<Result<_, _>>()?;
            own = Some(ArrayModels::new(&self.array, simulators));
        }
        Ok(ArrayAtPose { model: self, pose, own })
    }

    /// Returns the array of rangers.
    #[must_use]
    pub const fn array(&self) -> &Arc<RangerArray> {
        &self.array
    }

    /// Returns the scene, with the robot's body separate.
    #[must_use]
    pub const fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Returns a model of one of the rangers: sensor, air, settings and records are common to all.
    #[must_use]
    pub fn simulator(&self) -> &Simulator {
        &self.bare.simulators[0]
    }

    /// Number of earlier slots whose firings a ranger may receive in a round; `None` without
    /// crosstalk.
    #[must_use]
    pub fn crosstalk_slots(&self) -> Option<usize> {
        self.bare.crosstalk.as_ref().map(|crosstalk| crosstalk.slots_back)
    }
}

impl ArrayModels {
    fn new(array: &RangerArray, simulators: Vec<Simulator>) -> Self {
        let crosstalk = Crosstalk::new(array, &simulators);
        Self { simulators, crosstalk }
    }
}

impl Crosstalk {
    /// Returns `None` if there is no crosstalk, or it is disabled.
    fn new(array: &RangerArray, simulators: &[Simulator]) -> Option<Self> {
        let simulator = simulators.first()?;
        let options = simulator.options().engine.paths()?;
        if options.without_crosstalk {
            return None;
        }
        let receiver = simulator.receiver();
        let absorption_np_per_m = simulator.path_settings().absorption_np_per_m;
        let slot_m = array.interval_ms * 1e-3 * receiver.sound_speed_m_s;
        let slots_back = crosstalk_slots(receiver, absorption_np_per_m, slot_m);
        if slots_back == 0 && !array.has_simultaneous_firings() {
            return None;
        }
        let longest_m = 2.0 * receiver.max_range_m + slots_back as f64 * slot_m;
        let engine = |simulator: &Simulator| simulator.stray_engine(longest_m);
        let engines = simulators.iter().map(engine).collect::<Option<_>>()?;
        Some(Self { slots_back, engines })
    }
}

impl ArrayAtPose<'_> {
    /// Returns the array of rangers.
    #[must_use]
    pub fn array(&self) -> &RangerArray {
        &self.model.array
    }

    /// Returns the robot's pose.
    #[must_use]
    pub const fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Predicts the reading of a ranger that fires alone, by its index in the array.
    ///
    /// # Errors
    /// When there are more paths than can be found within bounds of work and memory.
    pub fn ping(&self, ranger: usize) -> Result<Prediction, TooCostly> {
        let pose = self.mounted(ranger);
        self.simulator(ranger).at(pose.position()).ping(pose.direction_rad(0.0))
    }

    /// Predicts the reading of a firing of a round, counted from 0 as in [`RangerArray::round`],
    /// with crosstalk from the others.
    ///
    /// # Errors
    /// As [`Self::ping`].
    ///
    /// # Panics
    /// When a round has no such firing.
    pub fn ping_in_round(&self, firing: usize) -> Result<Prediction, TooCostly> {
        let ranger = self.ranger_of(firing);
        let Some(others) = self.others(ranger, firing) else { return self.ping(ranger) };
        let pose = self.mounted(ranger);
        let point = self.simulator(ranger).at(pose.position());
        point.ping_among(pose.direction_rad(0.0), &others)
    }

    /// Predicts the reading of a firing of a round with receiver noise. The same generator in the
    /// same state gives the same reading.
    ///
    /// # Errors
    /// As [`Self::ping`].
    ///
    /// # Panics
    /// As [`Self::ping_in_round`].
    pub fn ping_in_noise(
        &self,
        firing: usize,
        noise: &ReceiverNoise,
        rng: &mut impl Rng,
    ) -> Result<Prediction, TooCostly> {
        let ranger = self.ranger_of(firing);
        let pose = self.mounted(ranger);
        let point = self.simulator(ranger).at(pose.position());
        let direction_rad = pose.direction_rad(0.0);
        match self.others(ranger, firing) {
            Some(others) => point.ping_among_in_noise(direction_rad, &others, noise, rng),
            None => point.ping_in_noise(direction_rad, noise, rng),
        }
    }

    /// Returns the model with which a ranger's predictions are to be described.
    #[must_use]
    pub fn simulator(&self, ranger: usize) -> &Simulator {
        &self.models().simulators[self.height(ranger)]
    }

    fn ranger_of(&self, firing: usize) -> usize {
        let ranger = self.model.array.round().nth(firing);
        ranger.unwrap_or_else(|| panic!("a round has no firing {firing}"))
    }

    /// Firings whose sound a ranger may receive in one of its own; `None` without crosstalk.
    pub(super) fn others(&self, ranger: usize, firing: usize) -> Option<OtherFirings<'_>> {
        let crosstalk = self.models().crosstalk.as_ref()?;
        let simulator = self.simulator(ranger);
        let aimed = |ranger: usize, end: usize| {
            let pose = self.mounted(ranger);
            let direction_rad = pose.direction_rad(0.0);
            let places =
                simulator.sensor().mounting.transducer_positions(pose.position(), direction_rad);
            TransducerPose { place: places[end], direction_rad }
        };
        let firings = self.model.array.interfering_firings(firing, crosstalk.slots_back);
        Some(OtherFirings {
            engine: &crosstalk.engines[self.height(ranger)],
            receiver: aimed(ranger, 1),
            sound_speed_m_s: simulator.sound_speed_m_s(),
            window_m: 2.0 * simulator.receiver().max_range_m,
            firings: firings.into_iter().map(|other| (other, aimed(other.ranger, 0))).collect(),
        })
    }

    fn models(&self) -> &ArrayModels {
        self.own.as_ref().unwrap_or(&self.model.bare)
    }

    fn height(&self, ranger: usize) -> usize {
        let z_m = self.model.array.rangers[ranger].z_m;
        self.model.heights.iter().position(|height| *height == z_m).unwrap_or(0)
    }

    fn mounted(&self, ranger: usize) -> Pose {
        self.model.array.rangers[ranger].world_pose(&self.pose)
    }
}
