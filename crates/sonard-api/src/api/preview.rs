//! A scan before it is taken.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::Pose;
use sonard_records::ScanPlan;

use super::{AirOrder, SensorOrder};

/// A scan that might be taken; what it leaves out is as in the next one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PreviewRequest {
    /// Where the ranger would stand.
    #[serde(default)]
    pub pose: Option<Pose>,
    /// Azimuths, at most 4000 beams.
    #[serde(default)]
    pub plan: Option<ScanPlan>,
    /// The air.
    #[serde(default)]
    pub air: Option<AirOrder>,
    /// The sensor.
    #[serde(default)]
    pub sensor: Option<SensorOrder>,
}
