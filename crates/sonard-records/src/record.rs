//! The log's records: one JSON object a line. These names are the project's public interface.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::{
    PathRecord, PingStatus, ScanPlan,
    session::{Provenance, Session},
};
use sonard_model::geometry::Pose;

/// One line of a log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Record {
    /// What is true for everything until the next session.
    Session(Box<Session>),
    /// A scan begins.
    ScanStart(ScanStart),
    /// One reading.
    Ping(Box<Ping>),
    /// A scan is over.
    ScanEnd(ScanEnd),
    /// Something happened that a reader of the data must know.
    Event(Event),
}

/// A scan begins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanStart {
    /// Identifies the scan in all its records.
    pub scan: Uuid,
    /// Wall clock.
    pub time: Timestamp,
    /// Where the ranger stands.
    pub pose: Pose,
    /// What is to be measured. Of an array, it has as many beams as the scan has firings; where they
    /// look is the array's.
    pub plan: ScanPlan,
    /// The air as it was known then; the session's if it is not here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub air: Option<ScanAir>,
    /// The session's, repeated for readers of a live stream, by sources that make readings up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
    /// The request to a daemon that it was taken for, if it was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request: Option<Uuid>,
}

impl ScanStart {
    /// A scan of the session's ranger, in the session's air, that nobody asked for.
    #[must_use]
    pub const fn new(scan: Uuid, time: Timestamp, pose: Pose, plan: ScanPlan) -> Self {
        Self { scan, time, pose, plan, air: None, provenance: None, request: None }
    }
}

/// The air of a scan, as it was known when it began.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanAir {
    /// Temperature, degrees Celsius.
    pub temperature_c: f64,
    /// Speed of sound that ranges were computed with, metres a second.
    pub sound_speed_m_s: f64,
    /// Who gave the temperature.
    pub source: AirSource,
    /// How old it was, seconds; `null` for a fixed one.
    pub age_s: Option<f64>,
}

/// Source of a temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AirSource {
    /// The configuration.
    Configuration,
    /// A thermometer's file.
    File,
    /// A program, through the API.
    Api,
}

/// One reading, measured or simulated, and beside a measured one what the model predicts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ping {
    /// The scan it belongs to.
    pub scan: Uuid,
    /// Index in the plan: stop times pings-per-stop plus ping.
    pub index: u32,
    /// Motor position, steps from home; of a ranger of an array, which has no motor, 0.
    pub step: i32,
    /// Azimuth, degrees counter-clockwise from the heading, in [0, 360).
    pub azimuth_deg: f64,
    /// Which ranger of the session's array; without it, the one on the stepper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ranger: Option<String>,
    /// Where the robot stood at firing, if that is not the scan's pose: `azimuth_deg` counts from
    /// its heading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
    /// The session's, repeated for readers of a live stream, by sources that make readings up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
    /// Wall clock at firing, from the fit of the device's clock.
    pub time: Option<Timestamp>,
    /// Standard deviation of `time`, microseconds.
    pub time_sigma_us: Option<f64>,
    /// What became of it.
    pub status: PingStatus,
    /// Device ticks at firing, extended past 32 bits.
    pub fired_ticks: Option<u64>,
    /// Times of the echoes after firing, device ticks.
    pub echo_ticks: Vec<u32>,
    /// Time of flight of the first echo, microseconds.
    pub tof_us: Option<f64>,
    /// Half the first echo's path, metres; `null` unless the status has a range.
    pub range_m: Option<f64>,
    /// Fetched again after the line lost it, or measured again.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub repaired: bool,
    /// Simulated readings only: amplitude relative to a head-on perfect wall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<f64>,
    /// Simulated readings only: amplitude above the threshold then in force, decibels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin_db: Option<f64>,
    /// Simulated readings only: the path the sound took.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<PathRecord>,
    /// Simulated readings only: whose sound it was, if not this firing's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crosstalk: Option<CrosstalkRecord>,
    /// What the model predicts for this firing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sim: Option<SimRecord>,
    /// Measured minus predicted range, metres, where both have one.
    pub residual_m: Option<f64>,
    /// How far Feature Prediction trusts it, from 0 (not at all) to 0.5 (nothing speaks against it);
    /// written by `sonard log annotate`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
}

impl Ping {
    /// A firing of which nothing is known but where it looked and what became of it.
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

/// A prediction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimRecord {
    /// What the model says becomes of the firing.
    pub status: PingStatus,
    /// Predicted range, metres.
    pub range_m: Option<f64>,
    /// Amplitude relative to a head-on, perfectly reflecting wall with gain compensation.
    pub amplitude: Option<f64>,
    /// Amplitude above the threshold then in force, decibels; negative for `no_echo`: what the
    /// best candidate lacked.
    pub margin_db: Option<f64>,
    /// The path the sound took (for `no_echo`, the best candidate's).
    pub path: Option<PathRecord>,
    /// Crosstalk: whose sound it was, if not this firing's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crosstalk: Option<CrosstalkRecord>,
}

/// Another firing of an array, whose sound a ranger received as an echo of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CrosstalkRecord {
    /// The ranger that fired.
    pub ranger: String,
    /// How long before, microseconds; 0 for one at the same time. The path is longer than twice the range by
    /// what sound runs meanwhile.
    pub before_us: f64,
}

/// A scan is over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanEnd {
    /// The scan.
    pub scan: Uuid,
    /// Wall clock.
    pub time: Timestamp,
    /// Beams of the plan that were measured.
    pub beams: u32,
    /// Beams of the plan that were not: a scan that was given up logs them as `link_lost`, one
    /// that was stopped on request leaves them out.
    pub missing: u32,
    /// Readings that the line lost at first.
    pub repaired: u32,
    /// Device time from the first firing to the end of the last listening window, seconds; after a
    /// restart of the device without the time in between, which its clock did not see.
    pub duration_s: f64,
    /// What no ordering could avoid in that span: every listening window, and between stops the
    /// step and its settling, seconds.
    pub acoustic_limit_s: f64,
    /// Where the index was found against where it was expected when the motor went home after
    /// the scan, steps; `null` if it did not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub home_drift_steps: Option<i32>,
    /// The session's, repeated for readers of a live stream, by sources that make readings up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

/// An event that matters for the interpretation of the data.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Event {
    /// Wall clock.
    pub time: Timestamp,
    /// What kind of thing.
    pub kind: EventKind,
    /// In words, with numbers.
    pub detail: String,
}

/// What an event says of a scan that somebody told a daemon to stop.
pub const STOPPED_ON_REQUEST: &str = "stopped on request";

/// Kinds of events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// The device stopped answering or the line hung up.
    LinkLost,
    /// It is back.
    Reconnected,
    /// The device restarted.
    Reboot,
    /// The device or the motor reported a fault.
    Fault,
    /// Records are known to be missing here.
    Gap,
    /// Stopped on request.
    Stopped,
    /// The computer's wall clock was set.
    ClockStep,
    /// The model could not say what would be heard; the readings that follow have no predictions.
    NoPrediction,
    /// Something else than what is believed would explain the readings of scans better, or no longer would.
    Explanation,
}
