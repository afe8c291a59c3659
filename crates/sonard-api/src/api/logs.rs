//! List of the logs on disk.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Log file on disk.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LogEntry {
    /// File name, for `GET /v1/logs/{name}`.
    pub name: String,
    /// File size, bytes.
    pub bytes: u64,
    /// `true` for the log that is being written.
    pub current: bool,
}
