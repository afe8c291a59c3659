//! A scan with everything it needs to know before a port is opened.

use std::sync::Arc;

use firmware_protocol::messages::{Identity, Settings};
use jiff::Timestamp;
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::{ModelError, Options, Simulator},
    scene::Scene,
};
use sonard_records::{ModelRecord, PlanError, ScanPlan, Session, SimRecord};
use thiserror::Error;

use super::{DeafWindow, Listening, Motion, ScanJob, device_record, provenance};

/// The inputs of a scan, each of them checked by itself.
#[derive(Debug, Clone)]
pub struct ScanInputs {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Where the ranger stands.
    pub pose: Pose,
    /// The pose as a person calls it.
    pub pose_text: String,
    /// Which azimuths.
    pub plan: ScanPlan,
    /// How the motor turns and the ranger listens.
    pub motion: Motion,
    /// The sensor's data.
    pub sensor: Sensor,
    /// The air.
    pub air: Air,
    /// How echoes are predicted.
    pub options: Options,
}

/// A scan that can be taken, with what the model says about it.
pub struct PreparedScan {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Where the ranger stands.
    pub pose: Pose,
    /// The pose as a person calls it.
    pub pose_text: String,
    /// Which azimuths.
    pub plan: ScanPlan,
    /// The model of it.
    pub simulator: Simulator,
    motion: Motion,
    listening: Listening,
    /// The sensor's data.
    pub sensor: Sensor,
    /// The air.
    pub air: Air,
    /// How echoes are predicted.
    pub options: Options,
    predictions: Vec<SimRecord>,
}

/// Inputs with which a scan can't be taken.
#[derive(Debug, Error)]
pub enum PrepareError {
    /// The window is over before the receiver opens.
    #[error("{0}")]
    Deaf(#[from] DeafWindow),
    /// The model refuses sensor or options.
    #[error("{0}")]
    Model(#[from] ModelError),
}

impl PreparedScan {
    /// Asks the model about every stop.
    ///
    /// # Errors
    /// When nothing can be heard in the listening window, or the model refuses.
    pub fn of(inputs: ScanInputs) -> Result<Self, PrepareError> {
        let ScanInputs { scene, pose, pose_text, plan, motion, sensor, air, options } = inputs;
        let listening = Listening {
            max_range_m: options.max_range_m.unwrap_or(sensor.max_range_m),
            sound_speed_m_s: air.sound_speed_m_s(),
            blanking_us: sensor.blanking_us,
        };
        motion.check_window(&listening)?;
        let simulator =
            Simulator::new(Arc::new(scene.with_robot_at(&pose)), sensor.clone(), air, options)?;
        // All firings at a stop have the same prediction.
        let stops = ScanPlan { pings_per_stop: 1, ..plan };
        let predictions = simulator
            .predict(&pose, &stops)
            .map_err(ModelError::from)?
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

    /// When the receiver opens, microseconds after firing.
    #[must_use]
    pub const fn blanking_us(&self) -> f64 {
        self.sensor.blanking_us
    }

    /// The pose as options take it.
    #[must_use]
    pub fn pose_numbers(&self) -> String {
        let Pose { x_m, y_m, heading_deg } = self.pose;
        format!("{x_m},{y_m},{heading_deg}")
    }

    /// The scan for a device of this identity.
    ///
    /// # Errors
    /// When the plan is not on the motor's steps.
    pub fn job(&self, identity: &Identity) -> Result<ScanJob, PlanError> {
        self.plan.motor_steps(u32::from(identity.steps_per_revolution))?;
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
    #[must_use]
    pub fn settings(&self, identity: &Identity) -> Settings {
        self.motion.settings(&self.listening, identity)
    }

    /// The session's record: what is true for every reading, and who measured.
    #[must_use]
    pub fn session(&self, identity: &Identity) -> Session {
        let (sensor, air) = (self.sensor.clone(), &self.air);
        let mut session = Session::new(Timestamp::now(), provenance(identity), sensor, air);
        session.set_scene(&self.scene);
        session.device = Some(device_record(identity));
        session.model = Some(ModelRecord::from(self.simulator.options()));
        session
    }
}
