//! Requests that are refused.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The reason why a request was not carried out.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct Problem {
    /// What is wrong.
    pub error: String,
    /// What would be right.
    pub help: String,
}
