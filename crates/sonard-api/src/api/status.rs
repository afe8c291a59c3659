//! Status of the daemon.

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

/// Complete status of the daemon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Status {
    /// Name of the robot (`fleet.robot`).
    pub robot: String,
    /// Version of the `sonard` program.
    pub sonard: String,
    /// Time since the start, seconds.
    pub uptime_s: f64,
    /// State of the link to the device.
    pub link: LinkReport,
    /// Device, once identified on the current connection.
    pub device: Option<Device>,
    /// Origin of readings: hardware, mock or model.
    pub provenance: Option<Provenance>,
    /// Scan mode and schedule.
    pub scanning: ScanningReport,
    /// Age of the last reading, seconds.
    pub last_reading_age_s: Option<f64>,
    /// Progress of the current scan.
    pub scan: Option<ScanProgress>,
    /// Current azimuths: those of the daemon's own scan in progress, or else of the next scan.
    pub plan: ScanPlan,
    /// Current pose of the ranger (of the scan that `plan` describes).
    pub pose: Pose,
    /// Current scene for predictions, if any (of the scan that `plan` describes).
    pub scene: Option<SceneRef>,
    /// Current air data (of the scan that `plan` describes).
    pub air: AirStatus,
    /// Current sensor for predictions (of the scan that `plan` describes).
    pub sensor: SensorFigures,
    /// Settings changed since the start of the current scan; they apply from the next scan on.
    pub pending: Pending,
    /// State of the log.
    pub log: LogStatus,
    /// Subscribers of live streams.
    pub subscribers: SubscriberReport,
    /// Endpoints of the API.
    #[serde(default)]
    pub server: ServerReport,
    /// State of the ROS 2 output, if enabled.
    #[serde(default)]
    pub ros: Option<RosReport>,
    /// State of the MQTT output, if a broker is configured.
    #[serde(default)]
    pub mqtt: Option<MqttReport>,
    /// Outcome of the last configuration reload.
    pub configuration: ConfigurationReport,
    /// Simulated array, if no device is used.
    pub simulation: Option<SimulationReport>,
}

/// Settings of the next scan that differ from those of the current one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pending {
    /// Azimuths of the next scan.
    pub plan: Option<ScanPlan>,
    /// Pose of the next scan.
    pub pose: Option<Pose>,
    /// Scene of the next scan.
    pub scene: Option<SceneRef>,
    /// Air data of the next scan.
    pub air: Option<AirStatus>,
    /// Sensor settings of the next scan.
    pub sensor: Option<SensorFigures>,
    /// Configured sensor, model and motion of the next scan.
    pub setup: Option<Setup>,
}

/// Current and pending settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InForce<T> {
    /// Current value: that of the daemon's own scan in progress, or else of the next scan.
    #[serde(flatten)]
    pub now: T,
    /// Value from the next scan on, if it differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pending: Option<T>,
}

/// Scan mode and schedule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanningReport {
    /// Current scan mode.
    pub mode: Mode,
    /// Interval between the starts of scans in mode `schedule`, seconds.
    pub every_s: f64,
    /// `true` if scans of the mode are suspended, from a stop until a start without a number; a
    /// change of the mode does not end the suspension. Requested scans are taken all the same, so a
    /// stop in mode `on-request` suspends nothing.
    pub paused: bool,
    /// Number of requested scans that have not begun yet.
    pub requested: u32,
    /// Time until the next scan, seconds, if known.
    pub next_in_s: Option<f64>,
}

/// Progress of the current scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanProgress {
    /// Id of the scan.
    pub scan: Uuid,
    /// Number of planned beams.
    pub beams: u32,
    /// Number of beams received.
    pub done: u32,
}

/// Subscribers of live streams.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SubscriberReport {
    /// Number of subscribers at present.
    pub now: usize,
    /// Readings dropped for slow subscribers.
    pub dropped_readings: u64,
    /// Subscribers disconnected because they stopped reading.
    pub cut_off: u64,
}

/// Outcome of the last configuration reload.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ConfigurationReport {
    /// Reason of a rejection; the previous configuration stays in use.
    pub error: Option<String>,
    /// Changed keys that take effect at the next start.
    pub needs_restart: Vec<String>,
}

/// State of the log.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogStatus {
    /// Log that is being written.
    pub file: Option<PathBuf>,
    /// Records written since the start.
    pub written: u64,
    /// Written records that are confirmed to be on the disk.
    pub synced: u64,
    /// Written records that will never be confirmed: their sync failed, or their file was removed
    /// or changed.
    #[serde(default)]
    pub uncertain: u64,
    /// Queued records that are not written yet.
    pub waiting: usize,
    /// Duration of the current write or sync, if longer than 5 s, seconds.
    #[serde(default)]
    pub busy_s: Option<f64>,
    /// Reason why records can't be written: no scan is taken until they can be.
    pub error: Option<String>,
    /// Log that had to be replaced within the last 30 s because it was removed, moved or changed,
    /// or its sync failed.
    #[serde(default)]
    pub incident: Option<String>,
}
