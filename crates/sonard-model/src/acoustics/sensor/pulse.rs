//! Transmitted pulse in a sensor's data.

use std::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{SensorError, figures::positive};

/// Transmitted pulse shape and bandwidth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Pulse {
    /// Carrier cycles of constant amplitude, filtered by transducer and receiver.
    Burst {
        /// Number of carrier cycles.
        cycles: f64,
        /// Standard deviation of the combined Gaussian band filter of transducer and receiver,
        /// hertz.
        bandwidth_hz: f64,
    },
    /// Sine with a Gaussian envelope.
    Gaussian {
        /// Standard deviation of the envelope, microseconds.
        sigma_us: f64,
    },
    /// Consecutive bursts of different frequencies.
    Chirp {
        /// Bursts in order of transmission.
        parts: Vec<ChirpPart>,
        /// As for a burst; centred on the sensor's `frequency_hz`.
        bandwidth_hz: f64,
    },
}

/// Burst of one frequency within a chirp.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChirpPart {
    /// Number of cycles of the burst.
    pub cycles: f64,
    /// Frequency of the burst, hertz.
    pub frequency_hz: f64,
}

impl Pulse {
    /// Standard deviation of the passband of transducer and receiver, hertz; for a Gaussian
    /// envelope that of its spectrum.
    #[must_use]
    pub fn bandwidth_hz(&self) -> f64 {
        match self {
            Self::Burst { bandwidth_hz, .. } | Self::Chirp { bandwidth_hz, .. } => *bandwidth_hz,
            Self::Gaussian { sigma_us } => 1e6 / (TAU * sigma_us),
        }
    }

    /// Multiplies the [bandwidth](Self::bandwidth_hz) by a factor.
    pub fn widen_band(&mut self, by: f64) {
        match self {
            Self::Burst { bandwidth_hz, .. } | Self::Chirp { bandwidth_hz, .. } => {
                *bandwidth_hz *= by;
            }
            Self::Gaussian { sigma_us } => *sigma_us /= by,
        }
    }

    pub(super) fn check(&self) -> Result<(), SensorError> {
        match self {
            Self::Burst { cycles, bandwidth_hz } => {
                positive("pulse.cycles", *cycles)?;
                positive("pulse.bandwidth_hz", *bandwidth_hz)
            }
            Self::Gaussian { sigma_us } => positive("pulse.sigma_us", *sigma_us),
            Self::Chirp { parts, bandwidth_hz } => {
                positive("pulse.parts (how many)", parts.len() as f64)?;
                for part in parts {
                    positive("pulse.parts.cycles", part.cycles)?;
                    positive("pulse.parts.frequency_hz", part.frequency_hz)?;
                }
                positive("pulse.bandwidth_hz", *bandwidth_hz)
            }
        }
    }
}
