//! The logs on disk.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LogEntry {
    /// Its name, for GET /v1/logs/{name}.
    pub name: String,
    /// Its size, bytes.
    pub bytes: u64,
    /// Whether it is the one being written.
    pub current: bool,
}
