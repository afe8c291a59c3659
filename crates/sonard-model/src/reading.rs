//! What a firing can come to, and how its sound can have come back: words that model, records and
//! comparisons share.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The outcome of one firing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PingStatus {
    /// An echo passed the threshold after blanking.
    Echo,
    /// The listening window ended without one.
    NoEcho,
    /// Sound was already there when blanking ended: something is closer than can be measured.
    MinRange,
    /// The reading never arrived from the device.
    LinkLost,
    /// Measured, but the motor may not have been where the step says.
    StepDoubtful,
    /// The module could not be fired: its ECHO line was stuck.
    ModuleFault,
}

impl PingStatus {
    /// Whether a range belongs to this status.
    #[must_use]
    pub const fn has_range(self) -> bool {
        matches!(self, Self::Echo | Self::MinRange)
    }
}

/// How the sound got back.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum PathKind {
    /// Mirror reflections only.
    Specular,
    /// Diffracted at an edge or free end, once or twice.
    Diffracted,
    /// Sent back by the roughness of the last wall.
    Scattered,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn echoes_and_the_least_range_have_ranges() {
        use PingStatus::{Echo, LinkLost, MinRange, ModuleFault, NoEcho, StepDoubtful};
        let all = [Echo, NoEcho, MinRange, LinkLost, StepDoubtful, ModuleFault];
        assert_eq!(all.map(PingStatus::has_range), [true, false, true, false, false, false]);
    }
}
