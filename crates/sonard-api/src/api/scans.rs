//! Scans in memory and in logs.

use std::sync::Arc;

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_interpret::compare::AnnotatedPing;
use sonard_model::geometry::Pose;
use sonard_records::{Event, Ping, Provenance, ScanEnd, ScanPlan, ScanStart, Session};
use uuid::Uuid;

/// Entry of the list of scans.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ListedScan {
    /// Id of the scan.
    pub scan: Uuid,
    /// Start of the scan.
    pub time: Timestamp,
    /// Log that contains the scan, for `GET /v1/logs/{name}`.
    pub log: String,
    /// Pose of the ranger.
    pub pose: Pose,
    /// Planned azimuths of the scan.
    pub plan: ScanPlan,
    /// Origin of the readings.
    pub provenance: Option<Provenance>,
    /// Name of the scene used for predictions.
    pub scene: Option<String>,
    /// End of the scan; `null` for one that is in progress or was interrupted.
    pub end: Option<ScanEnd>,
}

/// Scan with its annotated readings. The server streams it piecewise and never holds it in memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WholeScan {
    /// Session of the scan; `null` if missing in the log.
    pub session: Option<Arc<Session>>,
    /// Start record of the scan.
    pub start: Option<ScanStart>,
    /// Annotated readings, in the order of the log.
    pub pings: Vec<AnnotatedPing>,
    /// Events during the scan.
    pub events: Vec<Event>,
    /// End of the scan; `null` for one that is in progress or was interrupted.
    pub end: Option<ScanEnd>,
}

/// Latest scan with its readings as recorded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanReport {
    /// Start record of the scan.
    pub start: ScanStart,
    /// Readings in the order of arrival.
    pub pings: Vec<Ping>,
    /// Events during the scan.
    pub events: Vec<Event>,
    /// End record of the scan; `null` while in progress.
    pub end: Option<ScanEnd>,
}
