//! Which daemon a verb asks.

use std::path::PathBuf;

use super::{Failure, Outcome};
use crate::{
    client::{Client, ClientError, Place, ScansError},
    scan::SceneRef,
    scene::Scene,
    server::{TokenError, read_token},
};

/// Where the daemon is.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct DaemonArgs {
    /// Unix socket of the daemon
    #[arg(
        long,
        value_name = "PATH",
        env = "SONARD_SERVER_SOCKET",
        default_value = "/run/sonard/sonard.sock"
    )]
    socket: PathBuf,
    /// TCP address of the daemon, HOST:PORT, instead of its socket
    #[arg(long, value_name = "ADDRESS")]
    address: Option<String>,
    /// File with the daemon's token: over TCP it wants it for orders, from another computer for
    /// everything
    #[arg(long, value_name = "FILE", env = "SONARD_SERVER_TOKEN_FILE")]
    token_file: Option<PathBuf>,
}

impl DaemonArgs {
    pub(super) fn client(&self) -> Result<Client, Failure> {
        let Some(address) = &self.address else {
            return Ok(Client::new(Place::Socket(self.socket.clone()), None));
        };
        let host = address.strip_prefix("http://").unwrap_or(address).trim_end_matches('/');
        if host.contains('/') {
            return Err(Failure::input(
                format!("--address {address} is no address of a daemon"),
                "give HOST:PORT; the daemon speaks plain HTTP, so ask through a tunnel where \
                 others listen in",
            ));
        }
        let token = self.token_file.as_ref().map(|file| {
            read_token(file).map_err(|error| {
                let help = match error {
                    TokenError::Open(_) => error.help(file),
                    _ => "give --token-file a copy of the daemon's server.token_file".into(),
                };
                Failure::input(
                    format!("cannot read the token in {}: {error}", file.display()),
                    help,
                )
            })
        });
        Ok(Client::new(Place::Address(host.to_owned()), token.transpose()?))
    }
}

pub(super) fn refuse(error: &ClientError) -> Failure {
    Failure::device(error, error.help())
}

/// What it means for a verb that no more scans come.
pub(super) fn refuse_scans(error: &ScansError) -> Failure {
    match error {
        ScansError::Forgotten(_) => Failure::Found(Some(error.to_string())),
        other => Failure::device(other, other.help()),
    }
}

/// Predictions are the daemon's: with another scene they would not be what was asked for.
pub(super) fn check_scene(of_daemon: Option<&SceneRef>, scene: &Scene) -> Outcome {
    if of_daemon.is_some_and(|of_daemon| of_daemon.sha256 == scene.sha256) {
        return Ok(());
    }
    Err(Failure::input(
        format!(
            "the daemon predicts in {}, not in the scene {} as it is here",
            of_daemon
                .map_or_else(|| "no scene".into(), |scene| format!("its scene {}", scene.name)),
            scene.name
        ),
        "name that one here, or change place.scene of the daemon",
    ))
}
