//! Scans that were taken.

use std::sync::Arc;

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_interpret::compare::JudgedPing;
use sonard_model::geometry::Pose;
use sonard_records::{Event, Ping, Provenance, ScanEnd, ScanPlan, ScanStart, Session};
use uuid::Uuid;

/// A scan in a list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ListedScan {
    /// The scan.
    pub scan: Uuid,
    /// When it began.
    pub time: Timestamp,
    /// Its log, for GET /v1/logs/{name}.
    pub log: String,
    /// Where the ranger stood.
    pub pose: Pose,
    /// What was to be measured.
    pub plan: ScanPlan,
    /// Where its readings come from.
    pub provenance: Option<Provenance>,
    /// Name of the scene that the model was given.
    pub scene: Option<String>,
    /// How it ended; `null` for one under way, or broken off.
    pub end: Option<ScanEnd>,
}

/// A scan with its readings. The server never has it in memory: it writes it piece by piece.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WholeScan {
    /// What was true for it; `null` if the log lacks it.
    pub session: Option<Arc<Session>>,
    /// How it began.
    pub start: Option<ScanStart>,
    /// Its readings, in the order of the log.
    pub pings: Vec<JudgedPing>,
    /// What happened meanwhile.
    pub events: Vec<Event>,
    /// How it ended; `null` for one under way, or broken off.
    pub end: Option<ScanEnd>,
}

/// One scan, whole. The daemon does not keep it: its log does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanReport {
    /// How it began.
    pub start: ScanStart,
    /// Its readings.
    pub pings: Vec<Ping>,
    /// What happened meanwhile.
    pub events: Vec<Event>,
    /// How it ended.
    pub end: Option<ScanEnd>,
}
