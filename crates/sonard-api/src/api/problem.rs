//! Error responses of the API.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Body of an error response.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
pub struct Problem {
    /// Error message in English.
    pub error: String,
    /// Advice on how to correct the request.
    pub help: String,
    /// Setting at fault, such as `sensor.blanking_us` or `pose`, if it is a single one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
}
