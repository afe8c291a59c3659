//! Air temperature, humidity and pressure of scans.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_records::AirSource;

/// Request body of `PUT /v1/air`; omitted fields keep their current values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AirOrder {
    /// Air temperature, degrees Celsius.
    #[schemars(range(min = -20, max = 50))]
    pub temperature_c: f64,
    /// Relative humidity of the air, percent.
    #[serde(default)]
    #[schemars(range(min = 0, max = 100))]
    pub humidity_percent: Option<f64>,
    /// Static pressure of the air, kilopascals.
    #[serde(default)]
    #[schemars(range(min = 60, max = 110))]
    pub pressure_kpa: Option<f64>,
}

/// Current air data and the age of its temperature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AirStatus {
    /// Air temperature, degrees Celsius.
    pub temperature_c: f64,
    /// Relative humidity of the air, percent.
    pub humidity_percent: f64,
    /// Static pressure of the air, kilopascals.
    pub pressure_kpa: f64,
    /// Speed of sound, metres per second.
    pub sound_speed_m_s: f64,
    /// Source of the temperature.
    pub source: AirSource,
    /// Age of the temperature, seconds; `null` for a configured constant.
    pub age_s: Option<f64>,
    /// `true` if the temperature is older than `air.max_age_s`.
    pub stale: bool,
    /// Reason why the thermometer has no valid temperature at present; the last valid one stays in
    /// use.
    pub error: Option<String>,
}
