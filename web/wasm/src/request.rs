//! What the page asks.

use serde::Deserialize;
use sonard_model::{
    acoustics::Sensor,
    geometry::Pose,
    model::{EngineKind, OptionKeys},
    plan::ScanPlan,
};

/// A question of the page.
#[derive(Debug, Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Which scenes and sensors come along.
    Shipped,
    /// Takes settings; tells the floor plan.
    Set {
        /// All of them.
        settings: Box<Settings>,
    },
    /// Begins a sweep of an engine in place of its last one; tells how it starts.
    Stand {
        /// Whose.
        engine: EngineKind,
        /// Where the ranger stands.
        pose: Pose,
        /// What it measures.
        plan: ScanPlan,
        /// The scan of the log whose readings stand beside the model's, by its number.
        #[serde(default)]
        measured: Option<usize>,
    },
    /// The next readings of an engine's sweep.
    More {
        /// Whose.
        engine: EngineKind,
        /// At most so many.
        count: usize,
    },
    /// One beam of an engine's sweep: its echo trace, and the paths of all it hears.
    Beam {
        /// Whose.
        engine: EngineKind,
        /// Its number.
        index: u32,
    },
    /// Reads a log, or a table of readings; tells its scans.
    Log {
        /// All of the file.
        text: String,
        /// Where a table's readings were taken, if it does not say so itself.
        pose: Pose,
    },
}

/// What readings depend on besides the pose.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Text of a scene file.
    pub(crate) scene: String,
    /// The sensor.
    pub(crate) sensor: SensorChoice,
    /// The air.
    pub(crate) air: AirChoice,
    /// Of each engine what it knows of them; `engine` means nothing here.
    pub(crate) options: OptionKeys,
}

/// A sensor by name, or its data.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum SensorChoice {
    Preset(String),
    Data(Box<Sensor>),
}

/// The state of the air.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AirChoice {
    pub(crate) temperature_c: f64,
    pub(crate) humidity_percent: f64,
    #[serde(default = "usual_pressure_kpa")]
    pub(crate) pressure_kpa: f64,
    /// Given by hand instead of computed.
    #[serde(default)]
    pub(crate) sound_speed_m_s: Option<f64>,
}

const fn usual_pressure_kpa() -> f64 {
    101.325
}
