//! How the module times echoes and tells them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::SensorError;

/// More firings than this are no reading any more.
const MOST_FIRINGS: u32 = 100;

/// What the detector watches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Detector {
    /// The envelope of the sound.
    #[default]
    Envelope,
    /// The sound itself, as a comparator does: ECHO rises at the first crest of the carrier after the envelope passed the
    /// threshold, so that weak echoes are told whole cycles late.
    Carrier,
}

pub(super) const fn once() -> u32 {
    1
}

// The signature is serde's.
#[allow(clippy::trivially_copy_pass_by_ref)]
pub(super) const fn is_once(firings: &u32) -> bool {
    *firings == 1
}

pub(super) fn check_firings(firings: u32) -> Result<(), SensorError> {
    if (1..=MOST_FIRINGS).contains(&firings) {
        return Ok(());
    }
    let (field, value) = ("averaged_firings", f64::from(firings));
    Err(SensorError::Figure { field, value, expected: "from 1 to 100" })
}
