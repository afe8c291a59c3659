//! Amplifier gain in a sensor's data.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    SensorError,
    figures::{not_negative, positive},
};

/// Time-variable gain of the amplifier.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Gain {
    /// Compensates spreading: the threshold is the same for all ranges.
    Compensating {
        /// Exponent of the gain's rise with time during an echo: 0 if each echo is compensated by
        /// its path length, 0.5 in a plane, 1 in space.
        #[serde(default)]
        exponent: f64,
        /// Compensates air absorption as well.
        #[serde(default)]
        air: bool,
    },
    /// Rises in steps; within a step the effective threshold rises with range.
    Steps {
        /// Steps in order; the last one's `until_us` is `null`.
        steps: Vec<GainStep>,
    },
}

/// Step of the amplifier gain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GainStep {
    /// End of the step, microseconds after firing; `null` for the last.
    pub until_us: Option<f64>,
    /// Gain, decibels re the gain that compensates the spreading from a wall at 1 m.
    pub gain_db: f64,
}

impl Default for Gain {
    fn default() -> Self {
        Self::Compensating { exponent: 0.0, air: false }
    }
}

impl Gain {
    /// Returns `true` if air absorption is compensated.
    #[must_use]
    pub const fn compensates_absorption(&self) -> bool {
        matches!(self, Self::Compensating { air: true, .. })
    }

    pub(super) fn check(&self) -> Result<(), SensorError> {
        let steps = match self {
            Self::Compensating { exponent, .. } => return not_negative("gain.exponent", *exponent),
            Self::Steps { steps } => steps,
        };
        positive("gain.steps (how many)", steps.len() as f64)?;
        let mut last_us = 0.0;
        for (i, step) in steps.iter().enumerate() {
            let is_last = i + 1 == steps.len();
            let field = "gain.steps.until_us";
            match step.until_us {
                None if is_last => {}
                Some(until_us) if !is_last && until_us.is_finite() && until_us > last_us => {
                    last_us = until_us;
                }
                other => {
                    let value = other.unwrap_or(f64::NAN);
                    let expected = "later than the step before, and null for the last step only";
                    return Err(SensorError::OutOfRange { field, value, expected });
                }
            }
            if !step.gain_db.is_finite() {
                let (field, value) = ("gain.steps.gain_db", step.gain_db);
                return Err(SensorError::OutOfRange { field, value, expected: "a finite number" });
            }
        }
        Ok(())
    }
}
