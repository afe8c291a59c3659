//! Session record: the conditions of all records until the next session.

use std::sync::{Arc, OnceLock};

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use sonard_model::{
    acoustics::{Air, AirError, Sensor},
    array::RangerArray,
    model::Options,
    scene::Scene,
};

/// Version of the record format, written into every session. Sessions of other formats are
/// rejected.
pub const LOG_FORMAT: u32 = 1;

/// Source of a session's readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Provenance {
    /// Real ranger connected to the host.
    Hardware,
    /// Firmware's machine code in an emulator, with sound from the model.
    Emulator,
    /// Device state machine on a pty, with sound from the model.
    Mock,
    /// Model without a device.
    Simulated,
    /// Converted from another format.
    Imported,
    /// Readings of an earlier log, reported again by a device state machine on a pty.
    Replay,
}

/// Build of the program that writes a session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Build {
    /// Commit of the source, `unknown` outside of a checkout; ends in `-modified` after changes.
    pub commit: String,
    /// Cargo features of the program.
    pub features: Vec<String>,
}

/// Build of this process; programs declare it at their start, libraries have none.
static BUILD: OnceLock<Build> = OnceLock::new();

impl Build {
    /// Declares the build that new sessions of this process state. Later calls have no effect.
    pub fn declare(self) {
        drop(BUILD.set(self));
    }
}

/// Opening record of a log, repeated after each reconnection to a different device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Session {
    /// Version of the record format: [`LOG_FORMAT`].
    pub format: u32,
    /// Wall-clock time at the start.
    pub started: Timestamp,
    /// Version of the program that wrote the log.
    pub sonard: String,
    /// Commit and features of that program.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub build: Option<Build>,
    /// Source of the readings.
    pub provenance: Provenance,
    /// Name of the robot, if a daemon wrote the session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// Connected device; `null` for simulated scans.
    pub device: Option<Device>,
    /// Current parameters of the sensor.
    pub sensor: Sensor,
    /// Array of rangers with this sensor; default: one ranger on a stepper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<RangerArray>,
    /// Air conditions at the start of the session.
    pub air: AirRecord,
    /// Scene of the model.
    pub scene: Option<SceneRef>,
    /// Text of the scene file, which makes a log self-contained. The text is stored once per log:
    /// later sessions of the same scene omit it. A scene too long for a line is stored next to the
    /// log.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_text: Option<Arc<str>>,
    /// Model of the predictions stored with the readings.
    pub model: Option<ModelRecord>,
    /// Collection that the scans were taken for, if there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub collection: Option<Box<CollectionRef>>,
    /// Source file of imported readings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imported: Option<Box<ImportRef>>,
}

impl Session {
    /// Creates a session of this program without device, array, scene and model.
    #[must_use]
    pub fn new(started: Timestamp, provenance: Provenance, sensor: Sensor, air: &Air) -> Self {
        Self {
            format: LOG_FORMAT,
            started,
            sonard: env!("CARGO_PKG_VERSION").to_owned(),
            build: BUILD.get().cloned(),
            provenance,
            robot: None,
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

    /// Sets the scene and its text; a scene built without a file has no text.
    pub fn set_scene(&mut self, scene: &Scene) {
        self.scene = Some(SceneRef::from_scene(scene));
        self.scene_text = Some(Arc::clone(&scene.text)).filter(|text| !text.is_empty());
    }

    /// Air and options for predictions of this session's readings. The options are the defaults if
    /// the session has no model, and `None` if this program cannot set up its model.
    ///
    /// # Errors
    /// If the air is out of the range of the model.
    pub fn model_conditions(&self) -> Result<(Air, Option<Options>), AirError> {
        let options =
            self.model.as_ref().map_or_else(|| Some(Options::default()), ModelRecord::options);
        Ok((Air::try_from(&self.air)?, options))
    }
}

/// Source and interpretation of imported readings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImportRef {
    /// Name of the imported file.
    pub file: String,
    /// SHA-256 of the file's bytes, hexadecimal.
    pub sha256: String,
    /// Interpretation of the columns, in the form of the import options.
    pub mapping: serde_json::Map<String, serde_json::Value>,
    /// `true` if the poses of the scans come from the file or from the user. Otherwise they are
    /// unknown and set to the origin.
    pub poses_known: bool,
}

/// Place of a scan in a collection, with notes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CollectionRef {
    /// Identifier of the collection.
    pub id: Uuid,
    /// Name of the collection.
    pub name: String,
    /// Number of the pose, from 1.
    pub pose: u32,
    /// Name of the pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_name: Option<String>,
    /// Number of the scan at that pose, from 1.
    pub repeat: u32,
    /// Conditions by name and value.
    #[serde(default, skip_serializing_if = "serde_json::Map::is_empty")]
    pub conditions: serde_json::Map<String, serde_json::Value>,
}

/// Identity of a ranger.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Device {
    /// Serial number stored on the board.
    pub serial: String,
    /// Version of the firmware.
    pub firmware: String,
    /// Version of the serial protocol.
    pub protocol: u32,
    /// Boot nonce: a different value indicates a restart of the device.
    pub boot: String,
    /// Device clock, ticks per second.
    pub tick_hz: u32,
    /// Motor steps (as counted by the driver) per revolution.
    pub steps_per_revolution: u32,
}

/// Air conditions and the speed of sound that follows from them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AirRecord {
    /// Temperature of the air, degrees Celsius.
    pub temperature_c: f64,
    /// Relative humidity of the air, percent.
    pub humidity_percent: f64,
    /// Static pressure of the air, kilopascals.
    pub pressure_kpa: f64,
    /// Speed of sound, m/s.
    pub sound_speed_m_s: f64,
}

/// Reference to the scene file of the model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SceneRef {
    /// Name of the scene.
    pub name: String,
    /// SHA-256 of the file's bytes, hexadecimal.
    pub sha256: String,
}

impl SceneRef {
    /// Creates the reference to a scene.
    #[must_use]
    pub fn from_scene(scene: &Scene) -> Self {
        Self { name: scene.name.clone(), sha256: scene.sha256.clone() }
    }
}

/// Engine and settings of the predictions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ModelRecord {
    /// Engine: `paths`, `fan` or `cone`.
    pub engine: String,
    /// Settings of the engine, in the form of its options.
    #[serde(flatten)]
    pub settings: serde_json::Map<String, serde_json::Value>,
}
