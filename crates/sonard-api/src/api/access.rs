//! Permission of a client to change settings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Response of `GET /v1/access`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct AccessReport {
    /// Permission of this client to start scans and to change settings.
    pub write: WriteAccess,
}

/// Permission to start scans and to change settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WriteAccess {
    /// Permitted: a client of the unix socket, or one with a valid token.
    Yes,
    /// Permitted with the token of `server.token_file`.
    Token,
    /// Permitted on the unix socket only: no token is configured.
    No,
}
