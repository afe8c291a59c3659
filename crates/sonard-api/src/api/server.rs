//! The places where the API is served.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Places where the API is served.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ServerReport {
    /// Paths of unix sockets and URLs where clients reach the daemon.
    pub listening: Vec<String>,
    /// Places where they do not although the configuration names them, each with the reason.
    pub trouble: Vec<String>,
}
