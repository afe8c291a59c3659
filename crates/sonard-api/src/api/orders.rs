//! Requests that start and cancel scans, and their responses.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::Pose;
use sonard_records::ScanPlan;
use uuid::Uuid;

use crate::config::Mode;

/// Request body of `POST /v1/start`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScanRequest {
    /// Number of scans; omitted, the current mode resumes (on-request: one scan).
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub scans: Option<u32>,
    /// Azimuths for these scans only, instead of the current plan.
    #[serde(default)]
    pub plan: Option<ScanPlan>,
    /// Pose of the ranger for these scans only, instead of the current pose.
    #[serde(default)]
    pub pose: Option<Pose>,
}

/// Response to an accepted request for scans.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Started {
    /// Always `true` in a response.
    pub accepted: bool,
    /// Id of the request, stored in `scan_start.request` of its scans. Scans that the mode starts
    /// by itself have none.
    pub request: Uuid,
}

/// Request body of `POST /v1/cancel`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CancelRequest {
    /// Id of the request, as returned by `POST /v1/start`.
    pub request: Uuid,
}

/// Scan mode, as set by `PUT /v1/scanning`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scanning {
    /// Scan mode to set.
    pub mode: Mode,
    /// Interval between the starts of scans in mode `schedule`, seconds; omitted, it is unchanged.
    #[serde(default)]
    #[schemars(range(min = 1, max = 604_800))]
    pub every_s: Option<f64>,
}

/// Response to an accepted request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Accepted {
    /// Always `true` in a response.
    pub accepted: bool,
}
