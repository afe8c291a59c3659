//! Engine and receiver joined: what the ranger reads.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{
    Cone, Engine, Fan, ObservationPoint, Prediction,
    lazy::LazyArrivals,
    paths::{self, PathEngine},
};
use crate::{
    acoustics::{Air, BeamPattern, Disc, EdgeLawKind, Receiver, Response, Sensor, SensorError},
    geometry::{DVec2, Pose},
    plan::ScanPlan,
    scene::Scene,
};

mod settings;

use settings::{fan_settings, path_settings, receiver};

/// How echoes are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EngineKind {
    /// [`PathEngine`]: all echo paths, exactly.
    #[default]
    Paths,
    /// [`Fan`]: the ray model with reflections and diffraction.
    Fan,
    /// [`Cone`]: nearest hit within an aperture.
    Cone,
}

impl EngineKind {
    /// Its name in records and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paths => "paths",
            Self::Fan => "fan",
            Self::Cone => "cone",
        }
    }
}

/// Settings of the model; what is `None` comes from the sensor or the engine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// How echoes are found.
    pub engine: EngineKind,
    /// Half the longest path listened for, metres.
    pub max_range_m: Option<f64>,
    /// Least amplitude detected, relative to a head-on, perfectly reflecting wall.
    pub threshold: Option<f64>,
    /// From firing until the receiver listens, microseconds.
    pub blanking_us: Option<f64>,
    /// How the face answers to a pulse.
    pub response: Option<Response>,
    /// Detect one arrival at a time, and time it by its path alone
    /// ([`Combining::Ideal`](crate::acoustics::Combining::Ideal)); engines other than `paths` know no
    /// phases and always do.
    pub ideal_receiver: bool,
    /// Leave out the absorption of the air.
    pub lossless: bool,
    /// Most mirror reflections on a path (`paths`, `fan`); without it, as many as can matter.
    pub max_order: Option<u32>,
    /// What edges send back (`paths`; without it, the sensor's law). `fan` has Kuc and Siegel's law only.
    pub edge_law: Option<EdgeLawKind>,
    /// Also double diffraction, at two upright edges (`paths`).
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub double_diffraction: bool,
    /// Angle between the rays of `fan`, degrees. The default reads the same as a finer fan in
    /// every shipped scene as long as no round body is met (there is a test).
    pub ray_spacing_deg: f64,
    /// Full aperture of `cone`, degrees; without it, the sensor's two-way -6 dB width.
    pub aperture_deg: Option<f64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            engine: EngineKind::default(),
            max_range_m: None,
            threshold: None,
            blanking_us: None,
            response: None,
            ideal_receiver: false,
            lossless: false,
            max_order: None,
            edge_law: None,
            double_diffraction: false,
            ray_spacing_deg: 0.05,
            aperture_deg: None,
        }
    }
}

/// Why a simulator can't be made.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// The sensor's data make no sense.
    #[error("sensor: {0}")]
    Sensor(#[from] SensorError),
    /// An option out of range.
    #[error("{option} is {value}: it must be {expected}")]
    Option {
        /// Which option.
        option: &'static str,
        /// What it holds.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
}

/// Predicts readings in a scene.
pub struct Simulator {
    scene: Arc<Scene>,
    sensor: Sensor,
    air: Air,
    options: Options,
    receiver: Receiver,
    scatter_height_rad: f64,
    engine: Box<dyn Engine>,
}

impl Simulator {
    /// For a scene, a sensor in some air, and options.
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
        options.check()?;
        let receiver = receiver(&sensor, &air, &options);
        let beam = BeamPattern::new(&sensor, receiver.sound_speed_m_s);
        let scatter_height_rad = beam.two_way_power_rad();
        let engine: Box<dyn Engine> = match options.engine {
            EngineKind::Paths => {
                let settings =
                    path_settings(&sensor, &air, &options, &receiver, scatter_height_rad);
                let wave_number_per_m = settings.wave_number_per_m;
                let face = sensor.face.map(|face| Disc { face, wave_number_per_m });
                let engine = PathEngine::new(&scene, beam, face, settings);
                Box::new(engine.through_nulls(receiver.asks_incidents()))
            }
            EngineKind::Fan => {
                Box::new(Fan::new(&scene, beam, fan_settings(&sensor, &air, &options, &receiver)))
            }
            EngineKind::Cone => {
                let two_way_deg = || 2.0 * beam.angle_at(0.5_f64.sqrt()).to_degrees();
                Box::new(Cone::new(&scene, options.aperture_deg.unwrap_or_else(two_way_deg)))
            }
        };
        Ok(Self { scene, sensor, air, options, receiver, scatter_height_rad, engine })
    }

    /// Prepares for firing from `position` (world, metres). The costly part is done at the first
    /// firing that needs it and kept.
    #[must_use]
    pub fn at(&self, position: DVec2) -> ObservationPoint<'_> {
        ObservationPoint::new(self, position)
    }

    /// A reading for each firing of a checked plan, in the order of its indices.
    #[must_use]
    pub fn predict(&self, pose: &Pose, plan: &ScanPlan) -> Vec<Prediction> {
        let point = self.at(pose.position());
        (0..plan.stops())
            .flat_map(|stop| {
                let prediction = point.ping(pose.direction_rad(plan.azimuth_deg(stop)));
                vec![prediction; plan.pings_per_stop as usize]
            })
            .collect()
    }

    /// Speed of sound, metres a second.
    #[must_use]
    pub fn sound_speed_m_s(&self) -> f64 {
        self.receiver.sound_speed_m_s
    }

    /// The receiver in force: the sensor's, with the options applied.
    #[must_use]
    pub const fn receiver(&self) -> &Receiver {
        &self.receiver
    }

    /// The sensor.
    #[must_use]
    pub const fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// The air.
    #[must_use]
    pub const fn air(&self) -> &Air {
        &self.air
    }

    /// Settings of [`paths::Paths`] for this sensor, air and options.
    #[must_use]
    pub fn path_settings(&self) -> paths::Settings {
        path_settings(
            &self.sensor,
            &self.air,
            &self.options,
            &self.receiver,
            self.scatter_height_rad,
        )
    }

    /// The scene.
    #[must_use]
    pub const fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The height of the transducer, metres; `None` in a scene without floor and ceiling.
    #[must_use]
    pub fn sensor_z_m(&self) -> Option<f64> {
        let (floor_z_m, ceiling_z_m) = (self.scene.floor_z_m, self.scene.ceiling_z_m);
        floor_z_m.or(ceiling_z_m)?;
        let usual_z_m = || paths::usual_z_m(floor_z_m, ceiling_z_m);
        Some(self.sensor.mounting.z_m.unwrap_or_else(usual_z_m))
    }

    pub(super) fn arrivals_between(&self, at: [DVec2; 2]) -> LazyArrivals<'_> {
        LazyArrivals::new(self.engine.as_ref(), at, 2.0 * self.receiver.max_range_m)
    }

    /// The options.
    #[must_use]
    pub const fn options(&self) -> &Options {
        &self.options
    }
}

impl Options {
    fn check(&self) -> Result<(), ModelError> {
        let within = |option, value: f64, min: f64, max: f64, expected| {
            if (min..=max).contains(&value) {
                Ok(())
            } else {
                Err(ModelError::Option { option, value, expected })
            }
        };
        if let Some(range_m) = self.max_range_m {
            within("max_range_m", range_m, 0.01, 100.0, "from 0.01 to 100 metres")?;
        }
        if let Some(threshold) = self.threshold {
            within("threshold", threshold, 1e-6, 1.0, "from 0.000001 to 1")?;
        }
        if let Some(blanking_us) = self.blanking_us {
            within("blanking_us", blanking_us, 0.0, 1e5, "from 0 to 100000 microseconds")?;
        }
        if let Some(aperture_deg) = self.aperture_deg {
            within("aperture_deg", aperture_deg, 0.0, 180.0, "from 0 to 180 degrees")?;
        }
        within("ray_spacing_deg", self.ray_spacing_deg, 1e-4, 5.0, "from 0.0001 to 5 degrees")
    }
}
