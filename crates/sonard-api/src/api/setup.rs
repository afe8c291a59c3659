//! What the configuration decides about every scan.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::acoustics::Sensor;

use crate::config::{ModelKeys, MotionKeys};

/// Settings of every scan by the configuration, of which requests can change only the sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setup {
    /// The sensor's data.
    pub sensor: Sensor,
    /// How echoes are predicted, as configured.
    pub model: ModelKeys,
    /// How the motor turns and the ranger listens.
    pub motion: MotionKeys,
    /// Whether a thermometer's file is read.
    pub thermometer: bool,
}
