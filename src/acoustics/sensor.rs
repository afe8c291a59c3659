//! What is known about a ranger: one data file a preset, with a source for each figure.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A ranger's data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// The preset's name.
    pub name: String,
    /// What it is, in a sentence.
    pub description: String,
    /// Carrier frequency, hertz.
    pub frequency_hz: f64,
    /// Shape of the radiating face, and with it the beam pattern.
    pub aperture: Aperture,
    /// What it sends.
    pub pulse: Pulse,
    /// From firing until the receiver listens, microseconds.
    pub blanking_us: f64,
    /// The same when the blanking is shortened by hand, microseconds.
    #[serde(default)]
    pub short_blanking_us: Option<f64>,
    /// Farthest range it is made for, metres.
    pub max_range_m: f64,
    /// Least amplitude that is detected, relative to a head-on, perfectly reflecting wall with
    /// gain compensation.
    pub threshold: f64,
    /// For each figure above, by field name, where it comes from.
    pub sources: BTreeMap<String, String>,
}

/// Shape of the radiating face.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Aperture {
    /// Circular piston in a baffle.
    Piston {
        /// Radius, metres.
        radius_m: f64,
    },
    /// Line aperture in the plane of the scan.
    Line {
        /// Half length, metres.
        half_length_m: f64,
    },
    /// Amplitude `exp(-2 theta^2 / theta_o^2)` one way (Bozma and Kuc, equation 3).
    Gaussian {
        /// Half beam angle `theta_o`, degrees.
        half_angle_deg: f64,
    },
}

/// What the ranger sends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Pulse {
    /// So many cycles of the carrier at full strength.
    Burst {
        /// Number of cycles.
        cycles: f64,
    },
    /// A sine under a Gaussian envelope.
    Gaussian {
        /// Standard deviation of the envelope, microseconds.
        sigma_us: f64,
    },
}

impl Sensor {
    /// How long the pulse lasts, seconds (a Gaussian one: three sigma to each side).
    #[must_use]
    pub fn pulse_s(&self) -> f64 {
        match self.pulse {
            Pulse::Burst { cycles } => cycles / self.frequency_hz,
            Pulse::Gaussian { sigma_us } => 6.0 * sigma_us * 1e-6,
        }
    }
}
