//! Everything a scan needs to know before a port is opened.

use std::sync::Arc;

use firmware_protocol::messages::{
    Blanking, Capabilities, Identity, Settings,
    limits::{SHORT_BLANKING_TICKS_MIN, TICK_HZ},
};
use jiff::Timestamp;

use super::{super::mock_world::Belief, Args, MotionArgs};
use crate::{
    acoustics::{Air, Sensor},
    cli::Failure,
    geometry::Pose,
    model::{Options, Simulator},
    ranger::ScanJob,
    scan::{Device, LOG_FORMAT, Provenance, ScanPlan, SceneRef, Session, SimRecord},
    scene::Scene,
};

/// Blanking of the module when nothing shortens it, microseconds.
const INTERNAL_BLANKING_US: f64 = 2380.0;

/// The checked request.
pub(super) struct Setup {
    pub(super) scene: Arc<Scene>,
    pub(super) pose: Pose,
    pub(super) pose_text: String,
    pub(super) plan: ScanPlan,
    pub(super) simulator: Simulator,
    motion: MotionArgs,
    max_range_m: f64,
    pub(super) sensor: Sensor,
    air: Air,
    options: Options,
    predictions: Vec<SimRecord>,
}

impl Setup {
    pub(super) fn new(args: &Args) -> Result<Self, Failure> {
        let (scene, pose) = args.place.load()?;
        let scene = Arc::new(scene);
        let plan = args.azimuths.plan(args.pings_per_stop)?;
        let (sensor, air, options) =
            (args.sensor.sensor()?, args.air.air()?, args.engine.options()?);
        let simulator =
            Simulator::new(Arc::new(scene.with_robot_at(&pose)), sensor.clone(), air, options)
                .map_err(|error| Failure::input(error, "see `sonard scan --help`"))?;
        // All firings at a stop have the same prediction.
        let stops = ScanPlan { pings_per_stop: 1, ..plan };
        let predictions = simulator
            .predict(&pose, &stops)
            .iter()
            .map(|prediction| simulator.record(prediction))
            .collect();
        Ok(Self {
            pose,
            pose_text: args.place.pose.clone(),
            plan,
            motion: args.motion,
            max_range_m: options.max_range_m.unwrap_or(sensor.max_range_m),
            scene,
            simulator,
            sensor,
            air,
            options,
            predictions,
        })
    }

    pub(super) const fn belief(&self) -> Belief<'_> {
        Belief {
            scene: &self.scene,
            pose: &self.pose,
            sensor: &self.sensor,
            air: &self.air,
            options: &self.options,
        }
    }

    /// The pose as options take it.
    pub(super) fn pose_numbers(&self) -> String {
        let Pose { x_m, y_m, heading_deg } = self.pose;
        format!("{x_m},{y_m},{heading_deg}")
    }

    /// The scan for a device of this identity.
    pub(super) fn job(&self, identity: &Identity) -> Result<ScanJob, Failure> {
        self.plan.motor_steps(u32::from(identity.steps_per_revolution)).map_err(|error| {
            Failure::input(error, "give --from-deg and --step-deg on the motor's steps")
        })?;
        Ok(ScanJob {
            pose: self.pose,
            plan: self.plan,
            settings: self.settings(identity),
            sound_speed_m_s: self.air.sound_speed_m_s(),
            blanking_us: self.sensor.blanking_us,
            predictions: self.predictions.clone(),
        })
    }

    fn settings(&self, identity: &Identity) -> Settings {
        let can = |capability| identity.capabilities.has(capability);
        let motion = &self.motion;
        let window_ms =
            motion.window_ms.unwrap_or(2e3 * self.max_range_m / self.air.sound_speed_m_s());
        let shorter = self.sensor.blanking_us < INTERNAL_BLANKING_US;
        Settings {
            window_ticks: ticks(window_ms),
            min_interval_ticks: ticks(motion.min_interval_ms),
            settle_ticks: ticks(motion.settle_ms),
            max_echoes: if can(Capabilities::MULTIPLE_ECHOES) { motion.max_echoes } else { 1 },
            blanking: if shorter && can(Capabilities::SHORT_BLANKING) {
                let wanted = ticks(self.sensor.blanking_us / 1e3);
                let ticks = u16::try_from(wanted).unwrap_or(u16::MAX);
                Blanking::Short { ticks: ticks.max(SHORT_BLANKING_TICKS_MIN) }
            } else {
                Blanking::Internal
            },
            speed: motion.speed,
            acceleration: motion.acceleration,
            hold_s: 0,
        }
    }

    /// The session's record: what is true for every reading, and who measured.
    pub(super) fn session(&self, identity: &Identity) -> Session {
        Session {
            format: LOG_FORMAT,
            started: Timestamp::now(),
            sonard: env!("CARGO_PKG_VERSION").into(),
            provenance: provenance(identity),
            device: Some(device(identity)),
            sensor: self.sensor.clone(),
            air: self.air.to_record(),
            scene: Some(SceneRef {
                name: self.scene.name.clone(),
                sha256: self.scene.sha256.clone(),
            }),
            model: Some(self.simulator.model_record()),
        }
    }
}

/// The device says itself what it is: how its port was opened proves nothing.
pub(super) const fn provenance(identity: &Identity) -> Provenance {
    if identity.capabilities.has(Capabilities::SIMULATED) {
        Provenance::Mock
    } else if identity.capabilities.has(Capabilities::EMULATED) {
        Provenance::Emulator
    } else {
        Provenance::Hardware
    }
}

fn device(identity: &Identity) -> Device {
    let firmware = identity.firmware;
    Device {
        serial: serial_text(identity),
        firmware: format!("{}.{}.{}", firmware.major, firmware.minor, firmware.patch),
        protocol: identity.protocol.version.into(),
        boot: format!("{:04x}", identity.boot),
        tick_hz: identity.tick_hz,
        steps_per_revolution: identity.steps_per_revolution.into(),
    }
}

/// The serial number as text if it is text, else in hexadecimal.
pub(in crate::cli) fn serial_text(identity: &Identity) -> String {
    let text = std::str::from_utf8(&identity.serial).map(|text| text.trim_end_matches('\0'));
    match text {
        Ok(text) if text.chars().all(|c| c.is_ascii_graphic()) => text.to_owned(),
        _ => identity.serial.iter().map(|byte| format!("{byte:02x}")).collect(),
    }
}

fn ticks(ms: f64) -> u32 {
    (ms * f64::from(TICK_HZ) / 1e3).ceil() as u32
}
