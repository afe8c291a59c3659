//! State of the MQTT output.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// State of the connection to the broker.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct MqttReport {
    /// URL of the broker.
    pub broker: String,
    /// `true` while the broker is connected.
    pub connected: bool,
    /// Time of the last change of `connected`.
    pub since: Timestamp,
    /// Current error, if any.
    pub error: Option<String>,
    /// Number of connections since the start.
    pub connections: u64,
    /// Records acknowledged by the broker since the start.
    pub acknowledged: u64,
    /// Records sent but not acknowledged yet.
    pub waiting: u64,
    /// Log data after the last acknowledged record, bytes.
    pub lag_bytes: u64,
    /// Log lines skipped because they hold no record.
    pub skipped_lines: u64,
    /// Records rejected by the broker; they are skipped, and remain in the log.
    #[serde(default)]
    pub skipped: u64,
    /// Number of accepted commands.
    pub commands: u64,
    /// Number of rejected commands.
    pub rejected: u64,
}
