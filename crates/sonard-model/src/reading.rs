//! Outcomes of a firing and kinds of propagation path, shared by model, records and comparisons.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Outcome of one firing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PingStatus {
    /// Echo above the threshold after blanking.
    Echo,
    /// No echo in the detection window.
    NoEcho,
    /// Sound was already present at the end of blanking: an object is closer than the minimum
    /// range.
    MinRange,
    /// Reading lost between the device and the host.
    LinkLost,
    /// Measured, but the motor position is uncertain.
    StepUncertain,
    /// The module could not be fired: its ECHO line was stuck.
    ModuleFault,
}

impl PingStatus {
    /// Returns `true` if this status has a range.
    #[must_use]
    pub const fn has_range(self) -> bool {
        matches!(self, Self::Echo | Self::MinRange)
    }
}

/// Kind of propagation path.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum PathKind {
    /// Specular path: mirror reflections only.
    Specular,
    /// Diffraction at an edge or free end, once or twice.
    Diffracted,
    /// Backscatter from the roughness of the last wall.
    Scattered,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_by_status() {
        use PingStatus::{Echo, LinkLost, MinRange, ModuleFault, NoEcho, StepUncertain};
        let all = [Echo, NoEcho, MinRange, LinkLost, StepUncertain, ModuleFault];
        assert_eq!(all.map(PingStatus::has_range), [true, false, true, false, false, false]);
    }
}
