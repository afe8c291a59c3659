//! Configuration keys of the Foxglove WebSocket server.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Live messages for Foxglove and Lichtblick.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FoxgloveKeys {
    /// Enable live messages (restart).
    pub enabled: bool,
    /// Maximum number of simultaneous viewers (restart), separately for those with access (socket
    /// or token) and for all others.
    #[schemars(range(min = 1, max = 16))]
    pub max_clients: u32,
    /// Size of the shared queue for slow viewers, kilobytes; when it is full, the oldest messages
    /// are dropped and counted (restart).
    #[schemars(range(min = 16, max = 32_768))]
    pub queue_kb: u32,
    /// Publish a map of all scans since the start after each scan (restart), computed as by `sonard
    /// map`.
    pub map: bool,
    /// Web origins of browser viewers that may connect, in addition to this server's own host names
    /// (restart).
    pub origins: Vec<String>,
}

impl Default for FoxgloveKeys {
    fn default() -> Self {
        Self {
            enabled: false,
            max_clients: 8,
            queue_kb: 1024,
            map: false,
            origins: vec!["https://app.foxglove.dev".into()],
        }
    }
}
