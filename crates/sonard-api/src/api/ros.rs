//! Counters and state of the ROS 2 output.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Counters and state of the ROS 2 output.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct RosReport {
    /// DDS domain (ROS_DOMAIN_ID).
    pub domain: u16,
    /// Addresses of this computer that messages are sent from.
    pub networks: Vec<String>,
    /// `true` while messages are published.
    pub up: bool,
    /// Time of the last change of `up`.
    pub since: Timestamp,
    /// Current error, if any.
    pub error: Option<String>,
    /// Number of published topics.
    pub topics: u64,
    /// Number of matched subscriptions.
    pub subscriptions: u64,
    /// Messages published since the start.
    pub messages: u64,
    /// Messages dropped because the queue was full or they were too long.
    pub dropped: u64,
    /// Accepted commands: successful service calls and applied poses.
    pub commands: u64,
    /// Rejected commands: failed service calls and poses.
    pub rejected: u64,
    /// Reason of the last rejection.
    pub refusal: Option<String>,
}
