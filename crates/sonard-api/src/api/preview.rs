//! Preview of a scan.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::Pose;
use sonard_records::ScanPlan;

use super::{AirOrder, SensorOrder};

/// Request body of `POST /v1/preview`: a hypothetical scan. Omitted fields are those of the next
/// scan.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PreviewRequest {
    /// Pose of the ranger.
    #[serde(default)]
    pub pose: Option<Pose>,
    /// Azimuths, at most 4000 beams.
    #[serde(default)]
    pub plan: Option<ScanPlan>,
    /// Air data of the scan.
    #[serde(default)]
    pub air: Option<AirOrder>,
    /// Sensor settings of the scan.
    #[serde(default)]
    pub sensor: Option<SensorOrder>,
}
