//! Orders: what they say, and what is answered.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::Pose;
use sonard_records::ScanPlan;
use uuid::Uuid;

use crate::config::Mode;

/// A request for scans.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScanRequest {
    /// So many scans; without it, those of the mode go on (on-request: one scan).
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub scans: Option<u32>,
    /// Azimuths for these scans alone, instead of those in force.
    #[serde(default)]
    pub plan: Option<ScanPlan>,
    /// Where the ranger stands for these scans alone, instead of the pose in force.
    #[serde(default)]
    pub pose: Option<Pose>,
}

/// Scans were asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Started {
    /// Always `true`.
    pub accepted: bool,
    /// Identifies the request: `scan_start.request` of its scans bears it. Scans that the mode
    /// takes by itself bear none.
    pub request: Uuid,
}

/// A request to cancel another one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CancelRequest {
    /// As POST /v1/start gave it.
    pub request: Uuid,
}

/// When scans are taken.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scanning {
    /// The mode.
    pub mode: Mode,
    /// From the start of a scan to the start of the next, seconds, when the mode is schedule;
    /// without it, as it was.
    #[serde(default)]
    #[schemars(range(min = 1, max = 604_800))]
    pub every_s: Option<f64>,
}

/// An order was taken in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Accepted {
    /// Always `true`.
    pub accepted: bool,
}
