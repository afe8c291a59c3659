//! Everything a scan needs to know before a port is opened.

use std::sync::Arc;

use firmware_protocol::messages::{Identity, Settings};
use jiff::Timestamp;

use super::{super::mock_world::Belief, Args};
use crate::{
    acoustics::{Air, Sensor},
    cli::Failure,
    geometry::Pose,
    model::{Options, Simulator},
    ranger::{Listening, Motion, ScanJob, device_record, provenance},
    scan::{AirRecord, LOG_FORMAT, ModelRecord, ScanPlan, SceneRef, Session, SimRecord},
    scene::Scene,
};

/// What is to be measured, where and with what; each part is checked.
pub(in crate::cli) struct Wish {
    pub(in crate::cli) scene: Arc<Scene>,
    pub(in crate::cli) pose: Pose,
    /// The pose as a person calls it.
    pub(in crate::cli) pose_text: String,
    pub(in crate::cli) plan: ScanPlan,
    pub(in crate::cli) motion: Motion,
    pub(in crate::cli) sensor: Sensor,
    pub(in crate::cli) air: Air,
    pub(in crate::cli) options: Options,
}

/// The checked wish, with what the model says about it.
pub(in crate::cli) struct Setup {
    pub(in crate::cli) scene: Arc<Scene>,
    pub(super) pose: Pose,
    pub(super) pose_text: String,
    pub(super) plan: ScanPlan,
    pub(super) simulator: Simulator,
    motion: Motion,
    listening: Listening,
    pub(super) sensor: Sensor,
    air: Air,
    options: Options,
    predictions: Vec<SimRecord>,
}

impl Setup {
    pub(super) fn new(args: &Args) -> Result<Self, Failure> {
        let (scene, pose) = args.place.load()?;
        Self::of(Wish {
            scene: Arc::new(scene),
            pose,
            pose_text: args.place.pose.clone(),
            plan: args.azimuths.plan(args.pings_per_stop)?,
            motion: args.motion.motion(),
            sensor: args.sensor.sensor()?,
            air: args.air.air()?,
            options: args.engine.options()?,
        })
    }

    /// Asks the model about every stop.
    pub(in crate::cli) fn of(wish: Wish) -> Result<Self, Failure> {
        let Wish { scene, pose, pose_text, plan, motion, sensor, air, options } = wish;
        let listening = Listening {
            max_range_m: options.max_range_m.unwrap_or(sensor.max_range_m),
            sound_speed_m_s: air.sound_speed_m_s(),
            blanking_us: sensor.blanking_us,
        };
        motion.check_window(&listening).map_err(|deaf| Failure::input(deaf, deaf.help()))?;
        let simulator =
            Simulator::new(Arc::new(scene.with_robot_at(&pose)), sensor.clone(), air, options)
                .map_err(|error| Failure::input(error, "see `sonard scan --help`"))?;
        // All firings at a stop have the same prediction.
        let stops = ScanPlan { pings_per_stop: 1, ..plan };
        let predictions = simulator
            .predict(&pose, &stops)
            .iter()
            .map(|prediction| SimRecord::of(&simulator, prediction))
            .collect();
        Ok(Self {
            pose,
            pose_text,
            plan,
            motion,
            listening,
            scene,
            simulator,
            sensor,
            air,
            options,
            predictions,
        })
    }

    pub(in crate::cli) const fn belief(&self) -> Belief<'_> {
        Belief {
            scene: &self.scene,
            pose: &self.pose,
            sensor: &self.sensor,
            air: &self.air,
            options: &self.options,
        }
    }

    /// When the receiver opens, microseconds after firing.
    pub(in crate::cli) const fn blanking_us(&self) -> f64 {
        self.sensor.blanking_us
    }

    /// The pose as options take it.
    pub(in crate::cli) fn pose_numbers(&self) -> String {
        let Pose { x_m, y_m, heading_deg } = self.pose;
        format!("{x_m},{y_m},{heading_deg}")
    }

    /// The scan for a device of this identity.
    pub(in crate::cli) fn job(&self, identity: &Identity) -> Result<ScanJob, Failure> {
        self.plan.motor_steps(u32::from(identity.steps_per_revolution)).map_err(|error| {
            Failure::input(error, "give --from-deg and --step-deg on the motor's steps")
        })?;
        Ok(ScanJob {
            pose: self.pose,
            plan: self.plan,
            settings: self.settings(identity),
            sound_speed_m_s: self.air.sound_speed_m_s(),
            air: None,
            request: None,
            blanking_us: self.sensor.blanking_us,
            predictions: self.predictions.clone(),
        })
    }

    /// The settings for a device of this identity.
    pub(in crate::cli) fn settings(&self, identity: &Identity) -> Settings {
        self.motion.settings(&self.listening, identity)
    }

    /// The session's record: what is true for every reading, and who measured.
    pub(in crate::cli) fn session(&self, identity: &Identity) -> Session {
        Session {
            format: LOG_FORMAT,
            started: Timestamp::now(),
            sonard: env!("CARGO_PKG_VERSION").into(),
            provenance: provenance(identity),
            device: Some(device_record(identity)),
            sensor: self.sensor.clone(),
            array: None,
            air: AirRecord::from(&self.air),
            scene: Some(SceneRef::of(&self.scene)),
            scene_text: Some(Arc::clone(&self.scene.text)),
            model: Some(ModelRecord::from(self.simulator.options())),
            collection: None,
            imported: None,
        }
    }
}
