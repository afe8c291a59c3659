//! What the configuration decides about every scan.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    acoustics::Sensor,
    config::{ModelKeys, MotionKeys},
};

/// What the configuration decides about every scan; of it requests change the sensor alone.
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
