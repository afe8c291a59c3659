//! Which daemon a verb asks.

use std::path::{Path, PathBuf};

use super::{Failure, Outcome};
use crate::{
    client::{Client, ClientError, Endpoint, ScansError},
    fleet::{Asked, Member, MemberError, check_all, read_members},
    scan::SceneRef,
    scene::Scene,
    server::read_token,
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
    /// File with the daemon's token: needed over TCP for commands, from another computer for everything
    #[arg(long, value_name = "FILE", env = "SONARD_SERVER_TOKEN_FILE")]
    token_file: Option<PathBuf>,
}

impl DaemonArgs {
    pub(super) fn client(&self) -> Result<Client, Failure> {
        let Some(address) = &self.address else {
            return Ok(Client::new(Endpoint::Socket(self.socket.clone()), None));
        };
        let host = address.strip_prefix("http://").unwrap_or(address).trim_end_matches('/');
        if host.contains('/') {
            return Err(Failure::input(
                format!("--address {address} is no address of a daemon"),
                "give HOST:PORT; the daemon speaks plain HTTP, so ask through a tunnel where \
                 others listen in",
            ));
        }
        let token = self.token_file.as_deref().map(token).transpose()?;
        Ok(Client::new(Endpoint::Address(host.to_owned()), token))
    }
}

/// Which daemons a verb asks that may ask several.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct DaemonsArgs {
    /// Unix socket of the daemon; of each, if given several times
    #[arg(
        long,
        value_name = "PATH",
        env = "SONARD_SERVER_SOCKET",
        default_value = "/run/sonard/sonard.sock"
    )]
    socket: Vec<PathBuf>,
    /// TCP address of the daemon, HOST:PORT, instead of its socket; of each, if given several times
    #[arg(long, value_name = "ADDRESS")]
    address: Vec<String>,
    /// File with the daemon's token: needed over TCP for commands, from another computer for everything
    #[arg(long, value_name = "FILE", env = "SONARD_SERVER_TOKEN_FILE")]
    token_file: Option<PathBuf>,
    /// File that lists daemons, a [[daemon]] for each, or a configuration with [fleet]: all of them
    /// are asked
    #[arg(long, value_name = "FILE", conflicts_with = "address")]
    fleet: Option<PathBuf>,
}

/// One daemon, or several.
pub(super) enum Daemons {
    One(Client),
    Several(Vec<Asked>),
}

impl DaemonsArgs {
    pub(super) fn daemons(&self) -> Result<Daemons, Failure> {
        let (socket, address) = (self.socket.as_slice(), self.address.as_slice());
        if let (None, [socket], [] | [_]) = (&self.fleet, socket, address) {
            let one = DaemonArgs {
                socket: socket.clone(),
                address: address.first().cloned(),
                token_file: self.token_file.clone(),
            };
            return one.client().map(Daemons::One);
        }
        self.each().map(Daemons::Several)
    }

    /// All of them, each with what is known of it, also if it is one.
    pub(super) fn each(&self) -> Result<Vec<Asked>, Failure> {
        let wrong = |error: MemberError| Failure::input(&error, &error.help);
        if let Some(file) = &self.fleet {
            return asked(read_members(file).map_err(wrong)?);
        }
        let (socket, address) = (self.socket.as_slice(), self.address.as_slice());
        // One may be the default, which addresses stand in place of.
        let sockets = if socket.len() > 1 || address.is_empty() { socket } else { &[] };
        let sockets = sockets.iter().map(|path| Ok(Member::at_socket(path.clone())));
        let members = sockets.chain(address.iter().map(|address| Member::parse(address)));
        let members: Result<Vec<_>, _> = members.collect();
        let with_token = |member: Member| Member { token_file: self.token_file.clone(), ..member };
        let members = members.map_err(wrong)?.into_iter().map(with_token).collect();
        asked(check_all(members).map_err(wrong)?)
    }
}

/// Daemons with the way to ask them: their tokens are read.
pub(super) fn asked(members: Vec<Member>) -> Result<Vec<Asked>, Failure> {
    let asked = members.into_iter().map(|member| {
        let by_tcp = matches!(member.place, Endpoint::Address(_));
        let file = member.token_file.as_deref().filter(|_| by_tcp);
        let client = Client::new(member.place.clone(), file.map(token).transpose()?);
        Ok(Asked { member, client })
    });
    asked.collect()
}

fn token(file: &Path) -> Result<String, Failure> {
    read_token(file).map_err(|error| {
        let copy = || "give a copy of the daemon's server.token_file".into();
        let help = error.help(file).unwrap_or_else(copy);
        Failure::input(format!("cannot read the token in {}: {error}", file.display()), help)
    })
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
