//! Scan settings of the configuration.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::acoustics::Sensor;

use crate::config::{ModelKeys, MotionKeys};

/// Scan settings of the configuration. Requests can change only the sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setup {
    /// Data of the configured sensor.
    pub sensor: Sensor,
    /// Prediction settings, as configured.
    pub model: ModelKeys,
    /// Motor motion and listening window.
    pub motion: MotionKeys,
    /// `true` if a thermometer file is configured.
    pub thermometer: bool,
}
