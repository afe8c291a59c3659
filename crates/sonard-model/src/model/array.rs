//! Readings of the rangers of an array.

use std::sync::Arc;

use rand::Rng;

use super::{
    ModelError, Options, Prediction, Simulator, TooCostly,
    crosstalk::{Others, turns_heard},
    paths::{Aimed, PathEngine},
};
use crate::{
    acoustics::{Air, Mounting, ReceiverNoise, Sensor},
    array::RangerArray,
    geometry::Pose,
    scene::Scene,
};

/// Predicts what the rangers of an array read, each from its own place on the robot.
///
/// A robot's body, the array's or the scene's, turns and moves with the robot, so that it needs
/// another model for each pose; without one, poses share it. Rangers of different heights have a model
/// each.
///
/// # Crosstalk
///
/// In a round ([`ArrayAtPose::ping_in_round`]) a ranger also receives the sound of those that fire in the same turn
/// and of turns before, as far back as a perfect wall's echo could pass the threshold; with the engine `paths`
/// alone, and unless [`PathOptions::without_crosstalk`](super::PathOptions::without_crosstalk) leaves it out. The
/// robot is taken to stand still meanwhile, another ranger's sound to leave at the height of the one that listens.
/// What rough walls scatter from one to another is left out.
pub struct ArrayModel {
    array: Arc<RangerArray>,
    scene: Arc<Scene>,
    /// Of the scene without a robot's body.
    bare: Models,
    /// The heights that rangers have, each once.
    heights: Vec<Option<f64>>,
}

/// Models of a scene: of rangers at each of the heights.
struct Models {
    simulators: Vec<Simulator>,
    crosstalk: Option<Crosstalk>,
}

struct Crosstalk {
    /// Turns back that are listened for.
    turns_back: usize,
    /// For paths as long, at each height.
    engines: Vec<PathEngine>,
}

/// An array at a pose.
pub struct ArrayAtPose<'a> {
    model: &'a ArrayModel,
    pose: Pose,
    /// With the body among the reflectors, where there is one.
    own: Option<Models>,
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
        sensor: &Sensor,
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
        let simulator = |z_m: &Option<f64>| {
            let mounting = Mounting { z_m: z_m.or(sensor.mounting.z_m), ..sensor.mounting };
            Simulator::new(Arc::clone(&scene), Sensor { mounting, ..sensor.clone() }, air, options)
        };
        let simulators = heights.iter().map(simulator).collect::<Result<_, _>>()?;
        let bare = Models::new(&array, simulators);
        Ok(Self { array, scene, bare, heights })
    }

    /// The array at a pose.
    ///
    /// # Errors
    /// Never with a model that could be made.
    pub fn at(&self, pose: Pose) -> Result<ArrayAtPose<'_>, ModelError> {
        let mut own = None;
        if self.scene.robot.is_some() {
            let scene = Arc::new(self.scene.with_robot_at(&pose));
            let around = |simulator: &Simulator| simulator.in_scene(Arc::clone(&scene));
            let simulators = self.bare.simulators.iter().map(around).collect::<Result<_, _>>()?;
            own = Some(Models::new(&self.array, simulators));
        }
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
        &self.bare.simulators[0]
    }

    /// How many turns back firings are that a ranger may receive in a round; `None` where there is no crosstalk.
    #[must_use]
    pub fn turns_heard(&self) -> Option<usize> {
        self.bare.crosstalk.as_ref().map(|crosstalk| crosstalk.turns_back)
    }
}

impl Models {
    fn new(array: &RangerArray, simulators: Vec<Simulator>) -> Self {
        let crosstalk = Crosstalk::new(array, &simulators);
        Self { simulators, crosstalk }
    }
}

impl Crosstalk {
    /// `None` where there can't be any, or it is left out.
    fn new(array: &RangerArray, simulators: &[Simulator]) -> Option<Self> {
        let simulator = simulators.first()?;
        let options = simulator.options().engine.paths()?;
        if options.without_crosstalk {
            return None;
        }
        let receiver = simulator.receiver();
        let absorption_np_per_m = simulator.path_settings().absorption_np_per_m;
        let turn_m = array.interval_ms * 1e-3 * receiver.sound_speed_m_s;
        let turns_back = turns_heard(receiver, absorption_np_per_m, turn_m);
        if turns_back == 0 && !array.fires_together() {
            return None;
        }
        let longest_m = 2.0 * receiver.max_range_m + turns_back as f64 * turn_m;
        let engine = |simulator: &Simulator| simulator.stray_engine(longest_m);
        let engines = simulators.iter().map(engine).collect::<Option<_>>()?;
        Some(Self { turns_back, engines })
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

    /// The reading of a ranger that fires alone, by its index in the array.
    ///
    /// # Errors
    /// When there are more paths than can be found within bounds of work and memory.
    pub fn ping(&self, ranger: usize) -> Result<Prediction, TooCostly> {
        let pose = self.mounted(ranger);
        self.simulator(ranger).at(pose.position()).ping(pose.direction_rad(0.0))
    }

    /// The reading of a firing of a round, counted from 0 as in [`RangerArray::round`], with the sound of the others
    /// in its ear.
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

    /// The same in noise: the same generator in the same state gives the same reading.
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

    /// The model that a ranger's predictions are to be put into words with.
    #[must_use]
    pub fn simulator(&self, ranger: usize) -> &Simulator {
        &self.models().simulators[self.height(ranger)]
    }

    fn ranger_of(&self, firing: usize) -> usize {
        let ranger = self.model.array.round().nth(firing);
        ranger.unwrap_or_else(|| panic!("a round has no firing {firing}"))
    }

    /// The firings whose sound a ranger may receive in one of its own; `None` without crosstalk.
    pub(super) fn others(&self, ranger: usize, firing: usize) -> Option<Others<'_>> {
        let crosstalk = self.models().crosstalk.as_ref()?;
        let simulator = self.simulator(ranger);
        let aimed = |ranger: usize, end: usize| {
            let pose = self.mounted(ranger);
            let direction_rad = pose.direction_rad(0.0);
            let places = simulator.sensor().mounting.places(pose.position(), direction_rad);
            Aimed { place: places[end], direction_rad }
        };
        let firings = self.model.array.others(firing, crosstalk.turns_back);
        Some(Others {
            engine: &crosstalk.engines[self.height(ranger)],
            receiver: aimed(ranger, 1),
            sound_speed_m_s: simulator.sound_speed_m_s(),
            window_m: 2.0 * simulator.receiver().max_range_m,
            firings: firings.into_iter().map(|other| (other, aimed(other.ranger, 0))).collect(),
        })
    }

    fn models(&self) -> &Models {
        self.own.as_ref().unwrap_or(&self.model.bare)
    }

    fn height(&self, ranger: usize) -> usize {
        let z_m = self.model.array.rangers[ranger].z_m;
        self.model.heights.iter().position(|height| *height == z_m).unwrap_or(0)
    }

    fn mounted(&self, ranger: usize) -> Pose {
        self.model.array.rangers[ranger].pose_on(&self.pose)
    }
}
