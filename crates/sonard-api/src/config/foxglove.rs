//! The keys of live messages for viewers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Live messages for Foxglove and Lichtblick.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FoxgloveKeys {
    /// Whether there are any (restart).
    pub enabled: bool,
    /// Viewers at a time (restart): so many by the socket or with the token, and so many others.
    #[schemars(range(min = 1, max = 16))]
    pub max_clients: u32,
    /// Messages kept for viewers that are slow, all together, kilobytes; older ones are left out, with a
    /// count (restart).
    #[schemars(range(min = 16, max = 32_768))]
    pub queue_kb: u32,
    /// Whether a map of all scans since the start is told after each scan (restart), as `sonard map` makes it.
    pub map: bool,
    /// Origins of viewers from elsewhere that may ask in a browser, besides this server's own names
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
