//! Log records: one JSON object per line. The field names are a public interface of the project.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::{
    PathRecord, PingStatus, ScanPlan,
    session::{Provenance, Session},
};
use sonard_model::geometry::Pose;

/// Line of a log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Record {
    /// Conditions of all following records, until the next session.
    Session(Box<Session>),
    /// Start of a scan.
    ScanStart(ScanStart),
    /// Single reading of a scan.
    Ping(Box<Ping>),
    /// End of a scan.
    ScanEnd(ScanEnd),
    /// Event that affects the interpretation of the data.
    Event(Event),
}

/// Start of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanStart {
    /// Identifier of the scan in all its records.
    pub scan: Uuid,
    /// Wall-clock time of the record.
    pub time: Timestamp,
    /// Pose of the ranger.
    pub pose: Pose,
    /// Scan plan. For an array, the number of beams equals the number of firings; the directions
    /// are those of the array.
    pub plan: ScanPlan,
    /// Air conditions at the start of the scan; default: those of the session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub air: Option<ScanAir>,
    /// Provenance of the session, repeated by simulating sources for readers of a live stream.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
    /// Request to a daemon that the scan answers, if there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request: Option<Uuid>,
}

impl ScanStart {
    /// Start of an unrequested scan with the session's ranger, in the session's air.
    #[must_use]
    pub const fn new(scan: Uuid, time: Timestamp, pose: Pose, plan: ScanPlan) -> Self {
        Self { scan, time, pose, plan, air: None, provenance: None, request: None }
    }
}

/// Air conditions at the start of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanAir {
    /// Temperature of the air, degrees Celsius.
    pub temperature_c: f64,
    /// Speed of sound that ranges were computed with, m/s.
    pub sound_speed_m_s: f64,
    /// Source of the temperature.
    pub source: AirSource,
    /// Age of the temperature, seconds; `null` for a fixed one.
    pub age_s: Option<f64>,
}

/// Source of a temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AirSource {
    /// Value from the configuration file.
    Configuration,
    /// File of a thermometer.
    File,
    /// Program that uses the API.
    Api,
}

/// Single reading, measured or simulated. A measured one may have a prediction alongside.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ping {
    /// Identifier of the scan.
    pub scan: Uuid,
    /// Index in the plan: stop times pings-per-stop plus ping.
    pub index: u32,
    /// Motor position, steps from home; 0 for a ranger of an array, which has no motor.
    pub step: i32,
    /// Azimuth, degrees counter-clockwise from the heading, in [0, 360).
    pub azimuth_deg: f64,
    /// Id of the ranger in the session's array; default: the one on the stepper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ranger: Option<String>,
    /// Pose of the robot at firing, if it differs from the scan's pose. `azimuth_deg` is relative
    /// to its heading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
    /// Provenance of the session, repeated by simulating sources for readers of a live stream.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
    /// Wall-clock time of firing, from the fit of the device's clock.
    pub time: Option<Timestamp>,
    /// Standard deviation of `time`, microseconds.
    pub time_sigma_us: Option<f64>,
    /// Outcome of the firing.
    pub status: PingStatus,
    /// Device ticks at firing, extended past 32 bits.
    pub fired_ticks: Option<u64>,
    /// Times of the echoes after firing, device ticks.
    pub echo_ticks: Vec<u32>,
    /// Time of flight of the first echo, microseconds.
    pub tof_us: Option<f64>,
    /// Half the first echo's path, metres; `null` unless the status has a range.
    pub range_m: Option<f64>,
    /// Repeated after a loss on the line: transferred or measured again.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub repaired: bool,
    /// Simulated readings only: amplitude relative to a head-on perfect wall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<f64>,
    /// Simulated readings only: amplitude above the effective threshold, decibels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin_db: Option<f64>,
    /// Simulated readings only: propagation path of the echo.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<PathRecord>,
    /// Simulated readings only: firing that the sound came from, if not this one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crosstalk: Option<CrosstalkRecord>,
    /// Prediction of the model for this firing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sim: Option<SimRecord>,
    /// Measured minus predicted range, metres, where both have one.
    pub residual_m: Option<f64>,
    /// Confidence of Feature Prediction in the reading, from 0 (none) to 0.5 (no contradicting
    /// evidence); written by `sonard log annotate`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
}

impl Ping {
    /// Reading with no data except its azimuth and status.
    #[must_use]
    pub const fn new(scan: Uuid, index: u32, azimuth_deg: f64, status: PingStatus) -> Self {
        Self {
            scan,
            index,
            step: 0,
            azimuth_deg,
            ranger: None,
            pose: None,
            provenance: None,
            time: None,
            time_sigma_us: None,
            status,
            fired_ticks: None,
            echo_ticks: Vec::new(),
            tof_us: None,
            range_m: None,
            repaired: false,
            amplitude: None,
            margin_db: None,
            path: None,
            crosstalk: None,
            sim: None,
            residual_m: None,
            confidence: None,
        }
    }
}

/// Prediction of a reading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimRecord {
    /// Predicted outcome of the firing.
    pub status: PingStatus,
    /// Predicted range, metres; `null` without an echo.
    pub range_m: Option<f64>,
    /// Amplitude relative to a head-on, perfectly reflecting wall with gain compensation.
    pub amplitude: Option<f64>,
    /// Amplitude above the effective threshold, decibels; negative for `no_echo`: the deficit of
    /// the strongest candidate.
    pub margin_db: Option<f64>,
    /// Propagation path of the echo (for `no_echo`, of the strongest candidate).
    pub path: Option<PathRecord>,
    /// Crosstalk: firing that the sound came from, if not this one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crosstalk: Option<CrosstalkRecord>,
}

/// Other firing of an array whose sound a ranger received as its own echo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CrosstalkRecord {
    /// Id of the ranger that fired.
    pub ranger: String,
    /// Lead of the other firing, microseconds; 0 for a simultaneous one. The path is longer than
    /// twice the range by the distance that sound travels in this time.
    pub before_us: f64,
}

/// End of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanEnd {
    /// Identifier of the scan.
    pub scan: Uuid,
    /// Wall-clock time of the record.
    pub time: Timestamp,
    /// Number of planned beams that were measured.
    pub beams: u32,
    /// Number of planned beams that were not measured. A failed scan logs them as `link_lost`; a
    /// scan stopped on request omits them.
    pub missing: u32,
    /// Number of readings that were lost on the line at first.
    pub repaired: u32,
    /// Device time from the first firing to the end of the last detection window, seconds. After a
    /// restart of the device, the time in between is not included, as the device's clock did not
    /// run.
    pub duration_s: f64,
    /// Physical minimum of the duration, seconds: all detection windows, and steps with settling
    /// between stops.
    pub acoustic_limit_s: f64,
    /// Position of the index mark relative to the expected one at homing after the scan, steps;
    /// `null` without homing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub home_drift_steps: Option<i32>,
    /// Provenance of the session, repeated by simulating sources for readers of a live stream.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

/// Event that affects the interpretation of the data.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Event {
    /// Wall-clock time of the record.
    pub time: Timestamp,
    /// Kind of the event.
    pub kind: EventKind,
    /// Free-text description of the event.
    pub detail: String,
}

/// Detail of the event of a scan that was stopped by a request to a daemon.
pub const STOPPED_ON_REQUEST: &str = "stopped on request";

/// Kinds of logged events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// The device stopped answering or the line hung up.
    LinkLost,
    /// The connection was restored.
    Reconnected,
    /// The device rebooted: its clock restarted.
    Reboot,
    /// The device or the motor reported a fault.
    Fault,
    /// Records are missing at this position.
    Gap,
    /// The scan was stopped on request.
    Stopped,
    /// The wall clock of the computer was set.
    ClockStep,
    /// The model could not compute predictions; the following readings have none.
    NoPrediction,
    /// Another hypothesis explains the readings of recent scans better than the current one, or no
    /// longer does.
    Explanation,
}
