//! Requests of the page.

use serde::Deserialize;
use sonard_model::{
    acoustics::Sensor,
    geometry::Pose,
    model::{EngineKind, OptionKeys},
    scan_plan::ScanPlan,
};

/// Request of the page, tagged by `type`.
#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Lists the built-in scenes and sensor presets.
    ListPresets,
    /// Sets scene, sensor, air and options; returns the floor plan.
    Configure {
        /// Settings, all of which are replaced.
        settings: Box<Settings>,
    },
    /// Starts a sweep, replacing the engine's running one; returns its session and start records.
    StartSweep {
        /// Engine that computes the sweep.
        engine: EngineKind,
        /// Pose of the robot.
        pose: Pose,
        /// Azimuths of a simulated sweep.
        plan: ScanPlan,
        /// Number of the logged scan whose readings are compared with predictions, if any.
        #[serde(default)]
        measured: Option<usize>,
    },
    /// Returns the next readings of an engine's sweep.
    NextReadings {
        /// Engine of the sweep.
        engine: EngineKind,
        /// Maximum number of readings.
        count: usize,
    },
    /// Returns echo trace and arrivals of one beam of an engine's sweep.
    Beam {
        /// Engine of the sweep.
        engine: EngineKind,
        /// Index of the beam.
        index: u32,
    },
    /// Loads a log or a table of readings; returns its scans.
    LoadLog {
        /// Content of the file.
        text: String,
        /// Pose of readings in a table without poses.
        pose: Pose,
    },
}

/// Settings of the model apart from the pose.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Text of a scene file.
    pub(crate) scene: String,
    pub(crate) sensor: SensorChoice,
    pub(crate) air: AirChoice,
    /// Options of all engines, each of which uses those it supports; `engine` is ignored.
    pub(crate) options: OptionKeys,
}

/// Sensor by preset name or by its parameters.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum SensorChoice {
    Preset(String),
    Data(Box<Sensor>),
}

/// State of the air.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AirChoice {
    pub(crate) temperature_c: f64,
    pub(crate) humidity_percent: f64,
    #[serde(default = "standard_pressure_kpa")]
    pub(crate) pressure_kpa: f64,
    /// Explicit speed of sound, which replaces the computed one.
    #[serde(default)]
    pub(crate) sound_speed_m_s: Option<f64>,
}

const fn standard_pressure_kpa() -> f64 {
    101.325
}
