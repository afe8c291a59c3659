//! The receiver's gain, as a sensor's data say.

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
    /// Makes up for it: the threshold is the same for all ranges.
    Compensating {
        /// Power of the time with which the gain still rises while an echo sounds: 0 if each echo
        /// is made up for by the length of its path, 0.5 in a plane, 1 in space.
        #[serde(default)]
        exponent: f64,
        /// Whether it makes up for what the air absorbs as well.
        #[serde(default)]
        air: bool,
    },
    /// Rises in steps; between them the threshold in force drifts up with the range.
    Steps {
        /// The steps in order; the last one's `until_us` is `null`.
        steps: Vec<GainStep>,
    },
}

/// A step of the gain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GainStep {
    /// When it ends, microseconds after firing; `null` for the last.
    pub until_us: Option<f64>,
    /// Gain, decibels above what makes up for the spreading from a wall at 1 m.
    pub gain_db: f64,
}

impl Default for Gain {
    fn default() -> Self {
        Self::Compensating { exponent: 0.0, air: false }
    }
}

impl Gain {
    /// Whether the absorption of the air is made up for.
    #[must_use]
    pub const fn makes_up_for_air(&self) -> bool {
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
                    return Err(SensorError::Figure { field, value, expected });
                }
            }
            if !step.gain_db.is_finite() {
                let (field, value) = ("gain.steps.gain_db", step.gain_db);
                return Err(SensorError::Figure { field, value, expected: "a finite number" });
            }
        }
        Ok(())
    }
}
