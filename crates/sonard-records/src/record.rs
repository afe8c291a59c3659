//! The log's records: one JSON object a line. These names are the project's public interface.

use std::sync::Arc;

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::{PathRecord, PingStatus, ScanPlan};
use sonard_model::{
    acoustics::{Air, Sensor},
    array::RangerArray,
    geometry::Pose,
    scene::Scene,
};

/// Version of the record format, written into every session. Format 1, in which paths had `walls` in place
/// of `interactions`, is read as well.
pub const LOG_FORMAT: u32 = 2;

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

/// Where the readings of a session come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Provenance {
    /// A real ranger.
    Hardware,
    /// The firmware's machine code in an emulator, with sound from the model.
    Emulator,
    /// The device machine on a pty, with sound from the model.
    Mock,
    /// The model alone.
    Simulated,
    /// Converted from another format.
    Imported,
    /// An earlier log played again.
    Replay,
}

/// Opens a log, and again after each reconnection to a different device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Session {
    /// Record format: [`LOG_FORMAT`], or of a log that was read an earlier one.
    pub format: u32,
    /// Wall clock at the start.
    pub started: Timestamp,
    /// Version of the program that wrote the log.
    pub sonard: String,
    /// Where the readings come from.
    pub provenance: Provenance,
    /// The ranger that answered; `null` for simulated scans.
    pub device: Option<Device>,
    /// The sensor's data in force.
    pub sensor: Sensor,
    /// The array, all of whose rangers are such sensors; without it, one ranger on a stepper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<RangerArray>,
    /// The air in force.
    pub air: AirRecord,
    /// The scene the model was given.
    pub scene: Option<SceneRef>,
    /// The text of that scene's file, so that a log is whole by itself. In a log it stands once: a
    /// later session of the same scene goes without, and so does one of a scene too long for a line,
    /// which is kept beside the log.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_text: Option<Arc<str>>,
    /// The model whose predictions stand beside the readings.
    pub model: Option<ModelRecord>,
    /// The collection that its scans were taken for, if it was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub collection: Option<Box<CollectionRef>>,
    /// The file that its readings were imported from, if they were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imported: Option<Box<ImportRef>>,
}

impl Session {
    /// One of this program without device, array, scene and model.
    #[must_use]
    pub fn new(started: Timestamp, provenance: Provenance, sensor: Sensor, air: &Air) -> Self {
        Self {
            format: LOG_FORMAT,
            started,
            sonard: env!("CARGO_PKG_VERSION").to_owned(),
            provenance,
            device: None,
            sensor,
            array: None,
            air: air.into(),
            scene: None,
            scene_text: None,
            model: None,
            collection: None,
            imported: None,
        }
    }

    /// Says which scene it is of, with its text; a scene that was never a file has none.
    pub fn set_scene(&mut self, scene: &Scene) {
        self.scene = Some(SceneRef::of(scene));
        self.scene_text = Some(Arc::clone(&scene.text)).filter(|text| !text.is_empty());
    }
}

/// What readings were imported from, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImportRef {
    /// The file's name.
    pub file: String,
    /// SHA-256 of the file's bytes, hexadecimal.
    pub sha256: String,
    /// What its columns were taken to mean, as it would be given again.
    pub mapping: serde_json::Map<String, serde_json::Value>,
    /// Whether the poses of its scans come from the file or from whoever imported it; else they are not known, and
    /// stand at the origin.
    pub poses_known: bool,
}

/// What a scan was taken for, and what was noted about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CollectionRef {
    /// Identifies the collection.
    pub id: Uuid,
    /// What it is called.
    pub name: String,
    /// Number of the pose, from 1.
    pub pose: u32,
    /// What the pose is called.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_name: Option<String>,
    /// Number of the scan at that pose, from 1.
    pub repeat: u32,
    /// Conditions: name and value.
    #[serde(default, skip_serializing_if = "serde_json::Map::is_empty")]
    pub conditions: serde_json::Map<String, serde_json::Value>,
}

/// Identity of a ranger.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Device {
    /// Serial number stored on the board.
    pub serial: String,
    /// Firmware version.
    pub firmware: String,
    /// Protocol version.
    pub protocol: u32,
    /// Boot nonce: another value means the device restarted.
    pub boot: String,
    /// Device clock, ticks a second.
    pub tick_hz: u32,
    /// Motor steps (as the driver counts them) a revolution.
    pub steps_per_revolution: u32,
}

/// Air conditions and the speed of sound that follows from them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AirRecord {
    /// Temperature, degrees Celsius.
    pub temperature_c: f64,
    /// Relative humidity, percent.
    pub humidity_percent: f64,
    /// Static pressure, kilopascals.
    pub pressure_kpa: f64,
    /// Speed of sound, metres a second.
    pub sound_speed_m_s: f64,
}

/// Which scene file the model used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SceneRef {
    /// The scene's own name.
    pub name: String,
    /// SHA-256 of the file's bytes, hexadecimal.
    pub sha256: String,
}

impl SceneRef {
    /// Of a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self { name: scene.name.clone(), sha256: scene.sha256.clone() }
    }
}

/// Which engine predicted, and with what settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ModelRecord {
    /// Engine: `paths`, `fan` or `cone`.
    pub engine: String,
    /// The engine's settings, as they would be given again.
    #[serde(flatten)]
    pub settings: serde_json::Map<String, serde_json::Value>,
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

/// Who gave a temperature.
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

/// Something happened that a reader of the data must know.
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
