//! Pose estimates of scans.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_inverse::{Misfit, PoseMode};
use uuid::Uuid;

/// Estimated poses of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Location {
    /// Id of the scan.
    pub scan: Uuid,
    /// Poses that fit the readings, most probable first.
    pub poses: Vec<PoseMode>,
    /// Possible causes if no pose fits the readings.
    pub diagnoses: Vec<Misfit>,
    /// Texts of these causes, each with what to check or to change.
    #[serde(default)]
    pub causes: Vec<String>,
    /// Reason why the scan could not be located.
    pub unavailable_reason: Option<String>,
}
