//! Simulator: joins an engine and a receiver to predict readings.

use std::sync::{Arc, OnceLock};

use thiserror::Error;

use super::{
    Cone, Engine, EngineOptions, Fan, ObservationPoint, Options, PathOptions, Prediction,
    cost::TooCostly,
    lazy::{LazyArrivals, ReachEstimate},
    options::OutOfRange,
    paths::{self, BoundedPattern, PathEngine},
};
use crate::{
    acoustics::{Air, BeamPattern, Disc, Receiver, Sensor, SensorError},
    geometry::{DVec2, Pose},
    scan_plan::ScanPlan,
    scene::Scene,
};

mod settings;

pub use settings::receiver;
use settings::{fan_settings, path_settings};

/// Errors in sensor, scene or options that prevent a simulator.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// The sensor data are invalid.
    #[error("sensor: {0}")]
    Sensor(#[from] SensorError),
    /// A transducer in the floor or above the ceiling.
    #[error(
        "the transducer's height is {z_m} m, outside the scene's {level} at {level_z_m} m: it must be between \
         floor and ceiling"
    )]
    SensorHeight {
        /// Height of the transducer, metres.
        z_m: f64,
        /// Name of the limit: "floor" or "ceiling".
        level: &'static str,
        /// Height of that floor or ceiling, metres.
        level_z_m: f64,
    },
    /// More echo paths than can be found.
    #[error(transparent)]
    TooCostly(#[from] TooCostly),
    /// An option out of range.
    #[error("{option} is {value}: it must be {expected}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// Value of the option.
        value: f64,
        /// Valid range, in words.
        expected: &'static str,
    },
}

/// Predicts readings in a scene.
pub struct Simulator {
    scene: Arc<Scene>,
    ranger: Arc<RangerSetup>,
    engine: Box<dyn Engine>,
}

/// All inputs of predictions except the scene.
struct RangerSetup {
    sensor: Sensor,
    air: Air,
    options: Options,
    receiver: Receiver,
    beam: BeamPattern,
    /// The pattern with the bounds of [`paths`], computed for the first engine of that kind.
    bounded: OnceLock<Arc<BoundedPattern>>,
    scatter_height_rad: f64,
    /// Leaves out echoes with more than one contact with cylinders and edges beside a cylinder.
    single_contacts: bool,
    expected: ReachEstimate,
}

impl RangerSetup {
    fn simulator(self: Arc<Self>, scene: Arc<Scene>) -> Result<Simulator, ModelError> {
        check_height(&scene, &self.sensor)?;
        let engine = self.engine(&scene);
        Ok(Simulator { scene, ranger: self, engine })
    }

    fn path_settings(&self, options: &PathOptions) -> paths::PathSettings {
        let Self { sensor, air, receiver, scatter_height_rad, single_contacts, .. } = self;
        let settings = path_settings(sensor, air, options, receiver, *scatter_height_rad);
        if *single_contacts { settings.with_single_contacts() } else { settings }
    }

    fn engine(&self, scene: &Scene) -> Box<dyn Engine> {
        let Self { sensor, air, receiver, beam, .. } = self;
        match &self.options.engine {
            EngineOptions::Paths(paths) => {
                let settings = self.path_settings(paths);
                let wave_number_per_m = settings.wave_number_per_m;
                let face = sensor.face.map(|face| Disc { face, wave_number_per_m });
                let bounded = || Arc::new(BoundedPattern::new(beam.clone(), face));
                let pattern = Arc::clone(self.bounded.get_or_init(bounded));
                let engine = PathEngine::with_pattern(scene, pattern, face, settings);
                Box::new(engine.through_nulls(receiver.needs_incidents()))
            }
            EngineOptions::Fan(fan) => {
                let settings = fan_settings(sensor, air, fan, receiver);
                Box::new(Fan::new(scene, beam.clone(), settings))
            }
            EngineOptions::Cone(cone) => {
                let two_way_deg = || 2.0 * beam.angle_at(0.5_f64.sqrt()).to_degrees();
                Box::new(Cone::new(scene, cone.aperture_deg.unwrap_or_else(two_way_deg)))
            }
        }
    }
}

fn check_height(scene: &Scene, sensor: &Sensor) -> Result<(), ModelError> {
    let Some(z_m) = sensor.mounting.z_m else { return Ok(()) };
    let levels = [("floor", scene.floor_z_m, 1.0), ("ceiling", scene.ceiling_z_m, -1.0)];
    for (level, level_z_m, up) in levels {
        if let Some(level_z_m) = level_z_m
            && up * (z_m - level_z_m) <= 0.0
        {
            return Err(ModelError::SensorHeight { z_m, level, level_z_m });
        }
    }
    Ok(())
}

impl Simulator {
    /// Creates a simulator for a scene, a sensor in some air, and options.
    ///
    /// # Errors
    /// When the sensor's data or an option are out of range.
    pub fn new(
        scene: Arc<Scene>,
        sensor: Sensor,
        air: Air,
        options: Options,
    ) -> Result<Self, ModelError> {
        sensor.check()?;
        options.check().map_err(|OutOfRange { option, value, expected }| ModelError::Option {
            option,
            value,
            expected,
        })?;
        let receiver = receiver(&sensor, &air, &options);
        let beam = BeamPattern::new(&sensor, receiver.sound_speed_m_s);
        let scatter_height_rad = beam.two_way_power_rad();
        let (bounded, expected) = Default::default();
        let ranger = RangerSetup {
            sensor,
            air,
            options,
            receiver,
            beam,
            bounded,
            scatter_height_rad,
            single_contacts: false,
            expected,
        };
        Arc::new(ranger).simulator(scene)
    }

    /// Returns the same ranger in another scene. Its receiver, its beam pattern and the pattern's
    /// bounds, which take longer to compute than a room's floor plan, are shared.
    ///
    /// # Errors
    /// When the transducer would be in the floor or above the ceiling.
    pub fn in_scene(&self, scene: Arc<Scene>) -> Result<Self, ModelError> {
        Arc::clone(&self.ranger).simulator(scene)
    }

    /// Returns the same ranger and scene without the echoes that touch cylinders more than once, or a
    /// cylinder and an upright edge. They are weak, and finding them takes most of the time near
    /// cylinders: a search among many scenes can leave them to its last comparison.
    ///
    /// # Errors
    /// As [`in_scene`](Self::in_scene).
    pub fn with_single_contacts(&self) -> Result<Self, ModelError> {
        let RangerSetup { sensor, receiver, beam, bounded, .. } = &*self.ranger;
        let ranger = RangerSetup {
            sensor: sensor.clone(),
            receiver: receiver.clone(),
            beam: beam.clone(),
            bounded: bounded.clone(),
            single_contacts: true,
            expected: ReachEstimate::default(),
            ..*self.ranger
        };
        Arc::new(ranger).simulator(Arc::clone(&self.scene))
    }

    /// Prepares for firing from `position` (world, metres). The costly part is done at the first
    /// firing that needs it and kept.
    #[must_use]
    pub fn at(&self, position: DVec2) -> ObservationPoint<'_> {
        ObservationPoint::new(self, position)
    }

    /// Predicts a reading for each firing of a checked plan, in the order of its indices.
    ///
    /// # Errors
    /// When there are more paths than can be found within bounds of work and memory.
    pub fn predict(&self, pose: &Pose, plan: &ScanPlan) -> Result<Vec<Prediction>, TooCostly> {
        let point = self.at(pose.position());
        let mut predictions = Vec::with_capacity(plan.beams() as usize);
        for stop in 0..plan.stops() {
            let prediction = point.ping(pose.direction_rad(plan.azimuth_deg(stop)))?;
            predictions.extend(vec![prediction; plan.pings_per_stop as usize]);
        }
        Ok(predictions)
    }

    /// Speed of sound, metres per second.
    #[must_use]
    pub fn sound_speed_m_s(&self) -> f64 {
        self.ranger.receiver.sound_speed_m_s
    }

    /// Returns the effective receiver: the sensor's, with the options applied.
    #[must_use]
    pub fn receiver(&self) -> &Receiver {
        &self.ranger.receiver
    }

    /// Returns the beam pattern of the sensor in the air.
    #[must_use]
    pub fn beam(&self) -> &BeamPattern {
        &self.ranger.beam
    }

    /// Returns the sensor whose readings are predicted.
    #[must_use]
    pub fn sensor(&self) -> &Sensor {
        &self.ranger.sensor
    }

    /// Returns the air of the scene.
    #[must_use]
    pub fn air(&self) -> &Air {
        &self.ranger.air
    }

    /// Returns the settings of [`paths::Paths`] for this sensor, air and options; for another
    /// engine with the defaults of `paths`.
    #[must_use]
    pub fn path_settings(&self) -> paths::PathSettings {
        let options = self.ranger.options.engine.paths().copied().unwrap_or_default();
        self.ranger.path_settings(&options)
    }

    /// Returns an engine for crosstalk from other transducers, up to a length of path in metres;
    /// `None` if the simulator's own engine is not `paths`.
    pub(super) fn stray_engine(&self, max_path_m: f64) -> Option<PathEngine> {
        self.ranger.options.engine.paths()?;
        let settings = paths::PathSettings { max_path_m, direct: true, ..self.path_settings() };
        let RangerSetup { receiver, beam, .. } = &*self.ranger;
        let engine = PathEngine::new(&self.scene, beam.clone(), None, settings);
        Some(engine.through_nulls(receiver.needs_incidents()))
    }

    /// Returns the scene of the predictions.
    #[must_use]
    pub const fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Height of the transducer, metres; `None` in a scene without floor and ceiling.
    #[must_use]
    pub fn sensor_z_m(&self) -> Option<f64> {
        sensor_z_m(&self.scene, &self.ranger.sensor)
    }

    pub(super) fn arrivals_between(&self, at: [DVec2; 2]) -> LazyArrivals<'_> {
        let RangerSetup { receiver, expected, .. } = &*self.ranger;
        LazyArrivals::new(self.engine.as_ref(), at, 2.0 * receiver.max_range_m, expected)
    }

    /// Returns the options of the model.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.ranger.options
    }
}

/// Height of a transducer in a scene, metres; `None` in a scene without floor and ceiling.
#[must_use]
pub fn sensor_z_m(scene: &Scene, sensor: &Sensor) -> Option<f64> {
    let (floor_z_m, ceiling_z_m) = (scene.floor_z_m, scene.ceiling_z_m);
    floor_z_m.or(ceiling_z_m)?;
    Some(sensor.mounting.z_m.unwrap_or_else(|| paths::default_sensor_z_m(floor_z_m, ceiling_z_m)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn height_outside_room_is_rejected() {
        let mut room = Scene::builder("room").build().expect("an empty room");
        let made = |room: &Scene, z_m: f64| {
            let mut sensor = Sensor::preset("senscomp-6500").expect("a preset");
            sensor.mounting.z_m = Some(z_m);
            let made =
                Simulator::new(Arc::new(room.clone()), sensor, Air::default(), Options::default());
            made.err().map_or_else(String::new, |error| error.to_string())
        };
        assert_eq!(made(&room, -7.0), "");
        (room.floor_z_m, room.ceiling_z_m) = (Some(0.0), Some(2.4));
        assert_eq!(made(&room, 1.0), "");
        for (z_m, level) in [(-0.1, "floor"), (0.0, "floor"), (2.4, "ceiling"), (3.0, "ceiling")] {
            assert!(made(&room, z_m).contains(level), "{z_m}");
        }
    }
}
