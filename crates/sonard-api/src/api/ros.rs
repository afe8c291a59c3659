//! What is told to ROS 2.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// State of the ROS 2 output.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct RosReport {
    /// The domain.
    pub domain: u16,
    /// The addresses of this computer that it is told by.
    pub networks: Vec<String>,
    /// Whether it is told.
    pub up: bool,
    /// Since when.
    pub since: Timestamp,
    /// What is wrong, if something is.
    pub trouble: Option<String>,
    /// Topics that are offered.
    pub topics: u64,
    /// Subscriptions to them.
    pub subscriptions: u64,
    /// Messages since the start.
    pub messages: u64,
    /// Messages that were left out because what waits for subscribers was too much, or they were too long.
    pub left_out: u64,
    /// Services that were called and did what was asked, and poses that were followed.
    pub commands: u64,
    /// Services that were called and refused, and poses that were.
    pub refused: u64,
    /// Why the last of them was refused.
    pub refusal: Option<String>,
}
