//! Echo detection and range reporting of the module.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::SensorError;

const MAX_FIRINGS: u32 = 100;

/// Signal that the detector compares with the threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Detector {
    /// Envelope of the received sound.
    #[default]
    Envelope,
    /// Carrier, as with a comparator: ECHO rises at the first carrier crest after the envelope has
    /// crossed the threshold. Weak echoes are therefore late by whole cycles.
    Carrier,
}

pub(super) const fn once() -> u32 {
    1
}

// Signature required by serde.
#[allow(clippy::trivially_copy_pass_by_ref)]
pub(super) const fn is_once(firings: &u32) -> bool {
    *firings == 1
}

pub(super) fn check_firings(firings: u32) -> Result<(), SensorError> {
    if (1..=MAX_FIRINGS).contains(&firings) {
        return Ok(());
    }
    let (field, value) = ("averaged_firings", f64::from(firings));
    Err(SensorError::OutOfRange { field, value, expected: "from 1 to 100" })
}
