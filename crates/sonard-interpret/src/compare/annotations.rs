//! Annotations that the API adds to the record of a reading.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::viewpoint::Viewpoint;
use sonard_records::{Ping, ScanView};

use super::{NotCompared, Verdict, classify};

/// Reading with its annotations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AnnotatedPing {
    /// Record of the reading.
    #[serde(flatten)]
    pub ping: Ping,
    /// Classification and viewpoint.
    #[serde(flatten)]
    pub annotations: Annotations,
}

/// Annotations that the API adds to the record of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Annotations {
    /// Classification against the prediction.
    pub verdict: Classification,
    /// Position and direction of the transducer at the time of firing; `null` if the scan record
    /// lacks them.
    pub viewpoint: Option<Viewpoint>,
}

/// Verdict on a reading, or the reason why there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Classification {
    /// Compared with the prediction, with this verdict.
    Compared(Verdict),
    /// Excluded from the comparison for this reason.
    NotCompared(NotCompared),
}

impl AnnotatedPing {
    /// Annotates a reading of a scan.
    #[must_use]
    pub fn new(ping: Ping, scan: &ScanView) -> Self {
        let beside = Annotations::for_ping(&ping, Some(scan));
        Self { ping, annotations: beside }
    }
}

impl Annotations {
    /// Annotations of a reading; only session and start of the scan are used.
    #[must_use]
    pub fn for_ping(ping: &Ping, scan: Option<&ScanView>) -> Self {
        let viewpoint = scan.filter(|scan| scan.scan == ping.scan);
        let viewpoint = viewpoint.and_then(|scan| scan.viewpoint(ping));
        Self { verdict: Classification::from_ping(ping), viewpoint }
    }
}

impl Classification {
    /// Classifies a reading against its prediction.
    #[must_use]
    pub fn from_ping(ping: &Ping) -> Self {
        classify(ping).verdict.map_or_else(Self::NotCompared, Self::Compared)
    }
}
