//! What the daemon tells about itself.

use firmware_protocol::host::LinkStats;
use jiff::Timestamp;
use schemars::JsonSchema;
use serde::Serialize;
use uuid::Uuid;

use super::{
    air::AirStatus, journal::LogStatus, machine::LinkState, settings::Setup,
    simulation::SimulationReport,
};
use crate::{
    config::Mode,
    geometry::Pose,
    scan::{Device, Event, Ping, Provenance, ScanEnd, ScanPlan, ScanStart, SceneRef},
};

/// What the daemon is doing.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Status {
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
    /// What was changed since the scan under way began: it counts from the next one on.
    pub pending: Pending,
    /// The log.
    pub log: LogStatus,
    /// Clients of live streams.
    pub subscribers: SubscriberReport,
    /// What became of the last change of the configuration.
    pub configuration: ConfigurationReport,
    /// The array that the model plays, where nothing is measured.
    pub simulation: Option<SimulationReport>,
}

/// What counts from the next scan on, where that differs from what the one under way is taken by.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Pending {
    /// Other azimuths.
    pub plan: Option<ScanPlan>,
    /// Another place.
    pub pose: Option<Pose>,
    /// Another scene.
    pub scene: Option<SceneRef>,
    /// Other air.
    pub air: Option<AirStatus>,
    /// Another sensor, model or motion.
    pub setup: Option<Setup>,
}

/// What is in force, and what is to be.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct InForce<T> {
    /// In force: for the daemon's own scan that is under way, else for the next.
    #[serde(flatten)]
    pub now: T,
    /// What counts from the next scan on, if that is something else.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pending: Option<T>,
}

/// The link to the device.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LinkReport {
    /// What it is doing or suffering.
    pub state: LinkState,
    /// Since when, by the wall clock.
    pub since: Timestamp,
    /// The port, as configured.
    pub port: String,
    /// What went wrong last and what to do, while the device can't be used.
    pub trouble: Option<String>,
    /// Failures since the device was last in proper use.
    pub failures: u32,
    /// Until the next try, seconds.
    pub retry_in_s: Option<f64>,
}

/// When scans are taken.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
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

/// How far a scan is.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ScanProgress {
    /// The scan.
    pub scan: Uuid,
    /// Beams of the plan.
    pub beams: u32,
    /// Beams that are in.
    pub done: u32,
}

/// Clients of live streams.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SubscriberReport {
    /// At the moment.
    pub now: usize,
    /// Readings that slow ones missed.
    pub dropped_readings: u64,
    /// Clients that were cut off because they took nothing.
    pub cut_off: u64,
}

/// What became of the last change of the configuration.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ConfigurationReport {
    /// Why it was refused, if it was; what was in force before is in force still.
    pub error: Option<String>,
    /// Keys whose change waits for the next start.
    pub needs_restart: Vec<String>,
}

/// Whether all is well, with the figures to judge by.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Health {
    /// Whether the device can be used, the log written, and the temperature is fresh.
    pub healthy: bool,
    /// Why not.
    pub reasons: Vec<String>,
    /// The serial line, since the start.
    pub line: LineTotals,
    /// Scans since the start.
    pub scans: ScanTotals,
    /// The device's clock in the last scan.
    pub clock: ClockReport,
}

/// Figures of the serial line since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct LineTotals {
    /// Bytes sent.
    pub bytes_sent: u64,
    /// Bytes received.
    pub bytes_received: u64,
    /// Frames received whose checksum was right.
    pub frames_received: u64,
    /// Frames whose checksum was wrong.
    pub crc_errors: u64,
    /// Frames that were damaged otherwise.
    pub framing_errors: u64,
    /// Requests sent again.
    pub retries: u64,
    /// Readings that were lost at first and fetched again.
    pub repaired: u64,
    /// Readings and answers that made no sense.
    pub refused: u64,
    /// Times that the device was lost from use.
    pub losses: u64,
}

/// Figures of the scans since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ScanTotals {
    /// Every beam was measured.
    pub completed: u64,
    /// Stopped on request.
    pub stopped: u64,
    /// Given up.
    pub failed: u64,
    /// Beams measured.
    pub beams: u64,
    /// Beams that scans lacked at their end.
    pub missing: u64,
    /// Restarts of the device that scans survived.
    pub restarts: u64,
}

/// The device's clock.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, JsonSchema)]
pub struct ClockReport {
    /// Deviation from its nominal rate, parts in a million.
    pub drift_ppm: Option<f64>,
    /// Standard deviation of the times in records, microseconds.
    pub sigma_us: Option<f64>,
    /// Times that the computer's wall clock was set.
    pub steps: u64,
}

/// One scan, whole. The daemon does not keep it: its log does.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ScanReport {
    /// How it began.
    pub start: ScanStart,
    /// Its readings.
    pub pings: Vec<Ping>,
    /// What happened meanwhile.
    pub events: Vec<Event>,
    /// How it ended.
    pub end: Option<ScanEnd>,
}

impl LineTotals {
    /// These and the figures of one connection more.
    pub(super) fn with(mut self, stats: &LinkStats) -> Self {
        let dropped = &stats.dropped;
        self.bytes_sent += stats.bytes_sent;
        self.bytes_received += stats.bytes_received;
        self.frames_received += stats.frames_received;
        self.crc_errors += u64::from(dropped.checksum);
        self.framing_errors += u64::from(dropped.stuffing) + u64::from(dropped.too_long);
        self.retries += stats.retries;
        self.repaired += stats.repaired;
        self.refused += stats.refused;
        self
    }
}
