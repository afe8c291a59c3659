//! Scans that were taken.

use std::sync::Arc;

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::{
    compare::{NotCompared, Verdict, judge},
    geometry::Pose,
    scan::{Event, Ping, Provenance, ScanEnd, ScanPlan, ScanStart, ScanView, Session},
    viewpoint::Viewpoint,
};

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

/// A reading and what is told beside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JudgedPing {
    /// The reading.
    #[serde(flatten)]
    pub ping: Ping,
    /// What explains it, and where its transducer was.
    #[serde(flatten)]
    pub beside: Beside,
}

/// What the API tells beside a reading, where its record alone does not say it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Beside {
    /// What explains the reading.
    pub verdict: Word,
    /// Where its transducer was when it fired, and where it pointed; `null` if its scan does not say.
    pub viewpoint: Option<Viewpoint>,
}

impl Beside {
    /// What is told of a reading of a scan. Of the scan, only session and start are looked at.
    #[must_use]
    pub fn of(ping: &Ping, scan: Option<&ScanView>) -> Self {
        let viewpoint = scan.filter(|scan| scan.scan == ping.scan);
        let viewpoint = viewpoint.and_then(|scan| scan.viewpoint(ping));
        Self { verdict: Word::of(ping), viewpoint }
    }
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

/// What explains a reading, or why it can't be compared with a prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Word {
    /// Compared with the prediction.
    Compared(Verdict),
    /// Not compared, and why.
    NotCompared(NotCompared),
}

impl Word {
    /// What explains this reading.
    #[must_use]
    pub fn of(ping: &Ping) -> Self {
        judge(ping).verdict.map_or_else(Self::NotCompared, Self::Compared)
    }
}

impl JudgedPing {
    /// A reading of a scan.
    #[must_use]
    pub fn of(ping: Ping, scan: &ScanView) -> Self {
        let beside = Beside::of(&ping, Some(scan));
        Self { ping, beside }
    }
}
