//! Polls status and health of one daemon.

use std::time::Duration;

use tokio::time::timeout;

use super::PollError;
use crate::{
    api::{Health, Status},
    client::{Client, ClientError},
};

/// Time limit of a poll.
const POLL_TIMEOUT: Duration = Duration::from_millis(1500);
/// Maximum size of a status and of a health response, bytes.
const MAX_BYTES: usize = 256 * 1024;

/// Status and health reported by a daemon.
#[derive(Debug, Clone, PartialEq)]
pub struct DaemonReport {
    /// Status of the daemon.
    pub status: Status,
    /// Health of the daemon.
    pub health: Health,
}

/// Requests status and health of a daemon, within 1.5 s.
///
/// # Errors
/// No valid response within the time limit.
pub async fn poll(client: &Client) -> Result<DaemonReport, PollError> {
    let both = async {
        tokio::try_join!(
            client.get_json_within("/v1/status", MAX_BYTES),
            client.get_json_within("/v1/health", MAX_BYTES),
        )
    };
    let response = timeout(POLL_TIMEOUT, both).await;
    let timed_out =
        || PollError::NoResponse(format!("no response within {:.1} s", POLL_TIMEOUT.as_secs_f64()));
    let (status, health) =
        response.map_err(|_| timed_out())?.map_err(|error| poll_error(&error))?;
    Ok(DaemonReport { status, health })
}

fn poll_error(error: &ClientError) -> PollError {
    let message = error.to_string();
    match error {
        ClientError::NoDaemon { .. } | ClientError::Timeout => PollError::NoResponse(message),
        // A connection that breaks before any response is a daemon that exits; a response that is
        // not HTTP comes from another program.
        ClientError::Closed(_) => PollError::NoResponse(message),
        ClientError::Rejected { status, .. }
            if [401, 403, 429].contains(&status.as_u16()) || status.is_server_error() =>
        {
            PollError::Rejected(message)
        }
        _ => PollError::Invalid(message),
    }
}
