//! Annotations that the API adds to the record of a reading.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::viewpoint::Viewpoint;
use sonard_records::{Ping, ScanView};

use super::{NotCompared, Verdict, judge};

/// Reading with its annotations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JudgedPing {
    /// Record of the reading.
    #[serde(flatten)]
    pub ping: Ping,
    /// Classification and viewpoint.
    #[serde(flatten)]
    pub beside: Beside,
}

/// Annotations that the API adds to the record of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Beside {
    /// Classification against the prediction.
    pub verdict: Word,
    /// Position and direction of the transducer at the time of firing; `null` if the scan record
    /// lacks them.
    pub viewpoint: Option<Viewpoint>,
}

/// Verdict on a reading, or the reason why there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Word {
    /// Compared with the prediction, with this verdict.
    Compared(Verdict),
    /// Excluded from the comparison for this reason.
    NotCompared(NotCompared),
}

impl JudgedPing {
    /// Annotates a reading of a scan.
    #[must_use]
    pub fn new(ping: Ping, scan: &ScanView) -> Self {
        let beside = Beside::for_ping(&ping, Some(scan));
        Self { ping, beside }
    }
}

impl Beside {
    /// Annotations of a reading; only session and start of the scan are used.
    #[must_use]
    pub fn for_ping(ping: &Ping, scan: Option<&ScanView>) -> Self {
        let viewpoint = scan.filter(|scan| scan.scan == ping.scan);
        let viewpoint = viewpoint.and_then(|scan| scan.viewpoint(ping));
        Self { verdict: Word::from_ping(ping), viewpoint }
    }
}

impl Word {
    /// Classifies a reading against its prediction.
    #[must_use]
    pub fn from_ping(ping: &Ping) -> Self {
        judge(ping).verdict.map_or_else(Self::NotCompared, Self::Compared)
    }
}
