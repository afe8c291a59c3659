//! What goes to an MQTT broker.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// State of the connection to the broker.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct MqttReport {
    /// The broker.
    pub broker: String,
    /// Whether it is there.
    pub connected: bool,
    /// Since when.
    pub since: Timestamp,
    /// What is wrong, if something is.
    pub trouble: Option<String>,
    /// Connections since the start.
    pub connections: u64,
    /// Records that it acknowledged since the start.
    pub acknowledged: u64,
    /// Records under way that it did not acknowledge yet.
    pub waiting: u64,
    /// What stands in the log behind the last record that it has, bytes.
    pub behind_bytes: u64,
    /// Lines of the log that were passed over because no record is on them.
    pub passed_over: u64,
    /// Records that the broker does not take: they were left out, and are in the log.
    #[serde(default)]
    pub left_out: u64,
    /// Commands that were taken.
    pub commands: u64,
    /// Commands that were refused.
    pub refused: u64,
}
