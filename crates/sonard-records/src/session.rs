//! The record that opens a log: what is true for everything until the next one.

use std::sync::Arc;

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

/// Version of the record format, written into every session. Sessions of other formats are rejected.
pub const LOG_FORMAT: u32 = 1;

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

/// The record that opens a log, and again follows each reconnection to a different device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Session {
    /// Record format: [`LOG_FORMAT`].
    pub format: u32,
    /// Wall clock at the start.
    pub started: Timestamp,
    /// Version of the program that wrote the log.
    pub sonard: String,
    /// Where the readings come from.
    pub provenance: Provenance,
    /// The robot it is of, where a daemon wrote it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
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

    /// Says which scene it is of, with its text; a scene that was never a file has none.
    pub fn set_scene(&mut self, scene: &Scene) {
        self.scene = Some(SceneRef::of(scene));
        self.scene_text = Some(Arc::clone(&scene.text)).filter(|text| !text.is_empty());
    }

    /// Air and options to predict this session's readings with: the default options if it names no model, `None` if
    /// this program cannot set up the model that it names.
    ///
    /// # Errors
    /// When the air is out of the range of the model.
    pub fn conditions(&self) -> Result<(Air, Option<Options>), AirError> {
        let options =
            self.model.as_ref().map_or_else(|| Some(Options::default()), ModelRecord::options);
        Ok((Air::try_from(&self.air)?, options))
    }
}

/// Source and interpretation of imported readings.
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

/// Place of a scan in a collection, with its notes.
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

/// Reference to the scene file of the model.
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

/// Engine and settings of the predictions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ModelRecord {
    /// Engine: `paths`, `fan` or `cone`.
    pub engine: String,
    /// The engine's settings, as they would be given again.
    #[serde(flatten)]
    pub settings: serde_json::Map<String, serde_json::Value>,
}
