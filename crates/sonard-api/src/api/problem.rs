//! Error responses of the API.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Body of an error response.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct Problem {
    /// Error message in English.
    pub error: String,
    /// Advice on how to correct the request.
    pub help: String,
}
