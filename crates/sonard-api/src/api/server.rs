//! Endpoints of the API.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Endpoints of the API, and those that could not be opened.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ServerReport {
    /// Paths of unix sockets and URLs that accept connections.
    pub listening: Vec<String>,
    /// Configured endpoints that are unavailable, each with the reason.
    pub errors: Vec<String>,
}
