//! Where scans were taken, as their readings say.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_inverse::{Doubt, Mode};
use uuid::Uuid;

/// The estimated pose of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Location {
    /// Which scan.
    pub scan: Uuid,
    /// The poses that explain its readings, most probable first.
    pub poses: Vec<Mode>,
    /// What may be wrong with readings that none of them explains.
    pub doubts: Vec<Doubt>,
    /// Why it could not be located, in words.
    pub lacks: Option<String>,
}
