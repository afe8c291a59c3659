//! Setup of a scan: checked inputs and predictions, before a port is opened.

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

use super::{Motion, ReceiverTiming, ScanJob, WindowTooShort, device_record, provenance};

/// Inputs of a scan, each validated on its own.
#[derive(Debug, Clone)]
pub struct ScanInputs {
    /// Room and obstacles, without the robot.
    pub scene: Arc<Scene>,
    /// Pose of the ranger in the scene.
    pub pose: Pose,
    /// Pose as the user entered it: a name or numbers.
    pub pose_text: String,
    /// Azimuths and firings per stop.
    pub plan: ScanPlan,
    /// Motor motion and receiver timing.
    pub motion: Motion,
    /// Acoustic data of the ranging module.
    pub sensor: Sensor,
    /// State of the air.
    pub air: Air,
    /// Options of the acoustic model.
    pub options: Options,
}

/// Scan that is ready to be taken, with its predictions.
pub struct PreparedScan {
    /// Room and obstacles, without the robot.
    pub scene: Arc<Scene>,
    /// Pose of the ranger in the scene.
    pub pose: Pose,
    /// Pose as the user entered it: a name or numbers.
    pub pose_text: String,
    /// Azimuths and firings per stop.
    pub plan: ScanPlan,
    /// Acoustic model of the scene with the robot.
    pub simulator: Simulator,
    motion: Motion,
    listening: ReceiverTiming,
    /// Acoustic data of the ranging module.
    pub sensor: Sensor,
    /// State of the air.
    pub air: Air,
    /// Options of the acoustic model.
    pub options: Options,
    predictions: Vec<SimRecord>,
}

/// Rejected inputs of a scan.
#[derive(Debug, Error)]
pub enum PrepareError {
    /// The listening window ends before the receiver opens.
    #[error("{0}")]
    WindowTooShort(#[from] WindowTooShort),
    /// The model rejects sensor or options.
    #[error("{0}")]
    Model(#[from] ModelError),
}

impl PreparedScan {
    /// Computes the prediction of every stop.
    ///
    /// # Errors
    /// If the listening window ends before the receiver opens, or the model rejects the inputs.
    pub fn new(inputs: ScanInputs) -> Result<Self, PrepareError> {
        let ScanInputs { scene, pose, pose_text, plan, motion, sensor, air, options } = inputs;
        let listening = ReceiverTiming {
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
            .map(|prediction| SimRecord::from_prediction(&simulator, prediction))
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

    /// End of the receiver's blanking, microseconds after firing.
    #[must_use]
    pub const fn blanking_us(&self) -> f64 {
        self.sensor.blanking_us
    }

    /// Pose in the syntax of the command line: `x,y,heading`.
    #[must_use]
    pub fn pose_argument(&self) -> String {
        let Pose { x_m, y_m, heading_deg } = self.pose;
        format!("{x_m},{y_m},{heading_deg}")
    }

    /// Builds the scan job for a device of the given identity.
    ///
    /// # Errors
    /// If an azimuth of the plan is not a multiple of the motor's step.
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

    /// Builds the settings for a device of the given identity.
    #[must_use]
    pub fn settings(&self, identity: &Identity) -> Settings {
        self.motion.settings(&self.listening, identity)
    }

    /// Builds the session record: the conditions common to all readings, and the device.
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
