//! What the daemon is doing.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::Pose;
use sonard_records::{Device, Provenance, ScanPlan, SceneRef};
use uuid::Uuid;

use super::{
    air::AirStatus, link::LinkReport, mqtt::MqttReport, ros::RosReport, sensor::SensorFigures,
    server::ServerReport, setup::Setup, simulation::SimulationReport,
};
use crate::config::Mode;

/// State of the daemon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Status {
    /// The robot's name (`fleet.robot`).
    pub robot: String,
    /// Version of the program.
    pub sonard: String,
    /// How long it runs, seconds.
    pub uptime_s: f64,
    /// The link to the device.
    pub link: LinkReport,
    /// The device, once it told its identity on this connection.
    pub device: Option<Device>,
    /// Whether readings come from hardware.
    pub provenance: Option<Provenance>,
    /// When scans are taken.
    pub scanning: ScanningReport,
    /// How long ago the last reading came in, seconds.
    pub last_reading_age_s: Option<f64>,
    /// The scan under way.
    pub scan: Option<ScanProgress>,
    /// Azimuths in force: of the daemon's own scan that is under way, else of the next.
    pub plan: ScanPlan,
    /// Where the ranger stands, likewise.
    pub pose: Pose,
    /// The scene that readings are predicted in, if there is one, likewise.
    pub scene: Option<SceneRef>,
    /// The air, likewise.
    pub air: AirStatus,
    /// The sensor that readings are predicted for, likewise.
    pub sensor: SensorFigures,
    /// What was changed since the scan under way began: it counts from the next one on.
    pub pending: Pending,
    /// The log.
    pub log: LogStatus,
    /// Clients of live streams.
    pub subscribers: SubscriberReport,
    /// Places where the API is served.
    #[serde(default)]
    pub server: ServerReport,
    /// What is told to ROS 2, if anything is.
    #[serde(default)]
    pub ros: Option<RosReport>,
    /// What goes to an MQTT broker, if one is named.
    #[serde(default)]
    pub mqtt: Option<MqttReport>,
    /// What became of the last change of the configuration.
    pub configuration: ConfigurationReport,
    /// The array that the model plays, where nothing is measured.
    pub simulation: Option<SimulationReport>,
}

/// Settings of the next scan that differ from those of the current one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pending {
    /// Other azimuths.
    pub plan: Option<ScanPlan>,
    /// Another place.
    pub pose: Option<Pose>,
    /// Another scene.
    pub scene: Option<SceneRef>,
    /// Other air.
    pub air: Option<AirStatus>,
    /// Another sensor, or other figures of it.
    pub sensor: Option<SensorFigures>,
    /// Another sensor, model or motion.
    pub setup: Option<Setup>,
}

/// Current and pending settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InForce<T> {
    /// In force: for the daemon's own scan that is under way, else for the next.
    #[serde(flatten)]
    pub now: T,
    /// What counts from the next scan on, if that is something else.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pending: Option<T>,
}

/// When scans are taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanningReport {
    /// The mode.
    pub mode: Mode,
    /// From the start of a scan to the start of the next, seconds, when the mode is schedule.
    pub every_s: f64,
    /// Whether scans that nobody asked for are held since a stop, until a start without a number;
    /// a change of the mode does not end that. Scans that are asked for are taken all the same, so
    /// a stop in on-request mode, which takes no others, holds nothing.
    pub paused: bool,
    /// Scans asked for and not yet begun.
    pub requested: u32,
    /// Until the next scan, seconds, if that is known.
    pub next_in_s: Option<f64>,
}

/// Progress of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanProgress {
    /// The scan.
    pub scan: Uuid,
    /// Beams of the plan.
    pub beams: u32,
    /// Beams that are in.
    pub done: u32,
}

/// Clients of live streams.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SubscriberReport {
    /// At the moment.
    pub now: usize,
    /// Readings that slow ones missed.
    pub dropped_readings: u64,
    /// Clients that were cut off because they took nothing.
    pub cut_off: u64,
}

/// The outcome of the last change of the configuration.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ConfigurationReport {
    /// Why it was refused, if it was; what was in force before is in force still.
    pub error: Option<String>,
    /// Keys whose change waits for the next start.
    pub needs_restart: Vec<String>,
}

/// State of the log.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogStatus {
    /// The log that is being written.
    pub file: Option<PathBuf>,
    /// Records written since the start.
    pub written: u64,
    /// Of those, records that are confirmed to be on the disk.
    pub synced: u64,
    /// Of those, records that will never be confirmed: their sync failed, or their file was removed or changed.
    #[serde(default)]
    pub uncertain: u64,
    /// Records that are not written yet.
    pub waiting: usize,
    /// Duration of a write or sync under way that takes more than 5 s, seconds.
    #[serde(default)]
    pub busy_s: Option<f64>,
    /// Reason why records can't be written: no scan is taken until they can be.
    pub error: Option<String>,
    /// A log that had to be replaced within the last 30 s: removed, moved, changed, or its sync failed.
    #[serde(default)]
    pub incident: Option<String>,
}
