//! Settings of the next scan, changed or previewed together.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::Pose;
use sonard_records::ScanPlan;

use super::{AirOrder, SensorOrder};

/// Request body of `PUT /v1/settings`, which changes several settings at once, and of
/// `POST /v1/preview`, which predicts a scan with them. Omitted settings are those of the next
/// scan.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SettingsOrder {
    /// Pose of the ranger.
    #[serde(default)]
    pub pose: Option<Pose>,
    /// Azimuths; a preview has at most 4000 beams.
    #[serde(default)]
    pub plan: Option<ScanPlan>,
    /// Air data of the scan.
    #[serde(default)]
    pub air: Option<AirOrder>,
    /// Sensor settings of the scan.
    #[serde(default)]
    pub sensor: Option<SensorOrder>,
}
