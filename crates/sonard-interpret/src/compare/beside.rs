//! What is told beside a reading, where its record alone does not say it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::viewpoint::Viewpoint;
use sonard_records::{Ping, ScanView};

use super::{NotCompared, Verdict, judge};

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

/// What the API adds to a reading's record.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Beside {
    /// What explains the reading.
    pub verdict: Word,
    /// Where its transducer was when it fired, and where it pointed; `null` if its scan does not say.
    pub viewpoint: Option<Viewpoint>,
}

/// The verdict on a reading, or the reason why there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Word {
    /// Compared with the prediction.
    Compared(Verdict),
    /// Not compared, and why.
    NotCompared(NotCompared),
}

impl JudgedPing {
    /// A reading of a scan.
    #[must_use]
    pub fn of(ping: Ping, scan: &ScanView) -> Self {
        let beside = Beside::of(&ping, Some(scan));
        Self { ping, beside }
    }
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

impl Word {
    /// What explains this reading.
    #[must_use]
    pub fn of(ping: &Ping) -> Self {
        judge(ping).verdict.map_or_else(Self::NotCompared, Self::Compared)
    }
}
