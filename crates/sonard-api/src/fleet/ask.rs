//! Asking one daemon how it is.

use std::time::Duration;

use tokio::time::timeout;

use super::Unheard;
use crate::{
    api::{Health, Status},
    client::{Client, ClientError},
};

/// How long a daemon may take to say how it is.
const LIMIT: Duration = Duration::from_millis(1500);
/// Longest status and longest health that are read, bytes.
const MOST_BYTES: usize = 256 * 1024;

/// A daemon's report of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// What it is doing.
    pub status: Status,
    /// Whether all is well.
    pub health: Health,
}

/// Asks a daemon how it is; it may take 1.5 s for its answer.
///
/// # Errors
/// When it does not say so.
pub async fn ask(client: &Client) -> Result<Told, Unheard> {
    let both = async {
        tokio::try_join!(
            client.get_json_within("/v1/status", MOST_BYTES),
            client.get_json_within("/v1/health", MOST_BYTES),
        )
    };
    let answer = timeout(LIMIT, both).await;
    let late = || Unheard::Silent(format!("no answer within {:.1} s", LIMIT.as_secs_f64()));
    let (status, health) = answer.map_err(|_| late())?.map_err(|error| unheard(&error))?;
    Ok(Told { status, health })
}

fn unheard(error: &ClientError) -> Unheard {
    let words = error.to_string();
    match error {
        ClientError::NoDaemon { .. } | ClientError::TooSlow => Unheard::Silent(words),
        // A connection that breaks before it said anything is a daemon that ends, and one that speaks
        // no HTTP is none.
        ClientError::Http(error) if !error.is_parse() => Unheard::Silent(words),
        ClientError::Refused { status, .. }
            if [401, 403, 429].contains(&status.as_u16()) || status.is_server_error() =>
        {
            Unheard::Refusing(words)
        }
        _ => Unheard::Strange(words),
    }
}
