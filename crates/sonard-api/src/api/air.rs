//! The air in which scans are taken.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_records::AirSource;

/// A change of the air; omitted fields stay as they are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AirOrder {
    /// Temperature, degrees Celsius.
    #[schemars(range(min = -20, max = 50))]
    pub temperature_c: f64,
    /// Relative humidity, percent.
    #[serde(default)]
    #[schemars(range(min = 0, max = 100))]
    pub humidity_percent: Option<f64>,
    /// Static pressure, kilopascals.
    #[serde(default)]
    #[schemars(range(min = 60, max = 110))]
    pub pressure_kpa: Option<f64>,
}

/// The air in force, with its age.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AirStatus {
    /// Temperature, degrees Celsius.
    pub temperature_c: f64,
    /// Relative humidity, percent.
    pub humidity_percent: f64,
    /// Static pressure, kilopascals.
    pub pressure_kpa: f64,
    /// Speed of sound, metres a second.
    pub sound_speed_m_s: f64,
    /// Who gave the temperature.
    pub source: AirSource,
    /// How old it is, seconds; `null` for a fixed one.
    pub age_s: Option<f64>,
    /// Older than the configuration allows.
    pub stale: bool,
    /// Why the thermometer has no valid temperature now, if so; the last valid one is kept.
    pub error: Option<String>,
}
