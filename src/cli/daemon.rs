//! Options that select one or more daemons.

use std::path::{Path, PathBuf};

use super::{Failure, Outcome, socket::default_socket};
use crate::{
    client::{Client, ClientError, Endpoint, ScansError},
    fleet::{Member, MemberError, PolledDaemon, check_members, read_members},
    scan::SceneRef,
    scene::Scene,
    server::read_token,
};

/// Options that select one daemon.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct DaemonArgs {
    /// Unix socket of the daemon [default: the user's in $XDG_RUNTIME_DIR/sonard if there is one,
    /// else /run/sonard/sonard.sock]
    #[arg(long, value_name = "PATH", env = "SONARD_SERVER_SOCKET")]
    socket: Option<PathBuf>,
    /// TCP address of the daemon, HOST:PORT, instead of its socket
    #[arg(long, value_name = "ADDRESS")]
    address: Option<String>,
    /// File with the daemon's token; needed for commands over TCP, and for everything from other
    /// computers
    #[arg(long, value_name = "FILE", env = "SONARD_SERVER_TOKEN_FILE")]
    token_file: Option<PathBuf>,
}

impl DaemonArgs {
    pub(super) fn client(&self) -> Result<Client, Failure> {
        let Some(address) = &self.address else {
            let socket = self.socket.clone().unwrap_or_else(default_socket);
            return Ok(Client::new(Endpoint::Socket(socket), None));
        };
        let host = address.strip_prefix("http://").unwrap_or(address).trim_end_matches('/');
        if host.contains('/') {
            return Err(Failure::input(
                format!("--address {address} is not the address of a daemon"),
                "give HOST:PORT; the daemon serves plain HTTP, so use a tunnel on an untrusted \
                 network",
            ));
        }
        let token = self.token_file.as_deref().map(token).transpose()?;
        Ok(Client::new(Endpoint::Address(host.to_owned()), token))
    }
}

/// Options that select any number of daemons.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct DaemonsArgs {
    /// Unix socket of the daemon; repeatable [default: the user's in $XDG_RUNTIME_DIR/sonard if
    /// there is one, else /run/sonard/sonard.sock]
    #[arg(long, value_name = "PATH", env = "SONARD_SERVER_SOCKET")]
    socket: Vec<PathBuf>,
    /// TCP address of the daemon, HOST:PORT, instead of its socket; repeatable
    #[arg(long, value_name = "ADDRESS")]
    address: Vec<String>,
    /// File with the daemon's token; needed for commands over TCP, and for everything from other
    /// computers
    #[arg(long, value_name = "FILE", env = "SONARD_SERVER_TOKEN_FILE")]
    token_file: Option<PathBuf>,
    /// File that lists daemons, a [[daemon]] for each, or a configuration with [fleet]; queries all
    #[arg(long, value_name = "FILE", conflicts_with = "address")]
    fleet: Option<PathBuf>,
}

/// Daemons selected by the options.
pub(super) enum Daemons {
    One(Client),
    Several(Vec<PolledDaemon>),
}

impl DaemonsArgs {
    pub(super) fn daemons(&self) -> Result<Daemons, Failure> {
        let (socket, address) = (self.socket.as_slice(), self.address.as_slice());
        if let (None, [] | [_], [] | [_]) = (&self.fleet, socket, address) {
            let one = DaemonArgs {
                socket: socket.first().cloned(),
                address: address.first().cloned(),
                token_file: self.token_file.clone(),
            };
            return one.client().map(Daemons::One);
        }
        self.each().map(Daemons::Several)
    }

    /// Returns all selected daemons with their configuration, even if there is only one.
    pub(super) fn each(&self) -> Result<Vec<PolledDaemon>, Failure> {
        let wrong = |error: MemberError| Failure::input(&error, &error.help);
        if let Some(file) = &self.fleet {
            return connect_all(read_members(file).map_err(wrong)?);
        }
        let (socket, address) = (self.socket.as_slice(), self.address.as_slice());
        let default = [default_socket()];
        // A single socket may be that of the environment, which addresses replace.
        let sockets = match (socket, address) {
            ([], []) => &default[..],
            ([_], [_, ..]) => &[],
            (sockets, _) => sockets,
        };
        let sockets = sockets.iter().map(|path| Ok(Member::from_socket(path.clone())));
        let members = sockets.chain(address.iter().map(|address| Member::parse(address)));
        let members: Result<Vec<_>, _> = members.collect();
        let with_token = |member: Member| Member { token_file: self.token_file.clone(), ..member };
        let members = members.map_err(wrong)?.into_iter().map(with_token).collect();
        connect_all(check_members(members).map_err(wrong)?)
    }
}

/// Creates a client for each daemon, with its token.
pub(super) fn connect_all(members: Vec<Member>) -> Result<Vec<PolledDaemon>, Failure> {
    let connect_all = members.into_iter().map(|member| {
        let by_tcp = matches!(member.endpoint, Endpoint::Address(_));
        let file = member.token_file.as_deref().filter(|_| by_tcp);
        let client = Client::new(member.endpoint.clone(), file.map(token).transpose()?);
        Ok(PolledDaemon { member, client })
    });
    connect_all.collect()
}

fn token(file: &Path) -> Result<String, Failure> {
    read_token(file).map_err(|error| {
        let copy = || "give a copy of the daemon's server.token_file".into();
        let help = error.help(file).unwrap_or_else(copy);
        Failure::input(format!("cannot read the token in {}: {error}", file.display()), help)
    })
}

pub(super) fn failure_from(error: &ClientError) -> Failure {
    Failure::device(error, error.help())
}

/// Converts the error of requested scans that ended early.
pub(super) fn scans_failure(error: &ScansError) -> Failure {
    match error {
        ScansError::Cancelled(_) => Failure::Found(Some(error.to_string())),
        other => Failure::device(other, other.help()),
    }
}

/// Checks that the daemon predicts in the given scene.
pub(super) fn check_scene(of_daemon: Option<&SceneRef>, scene: &Scene) -> Outcome {
    if of_daemon.is_some_and(|of_daemon| of_daemon.sha256 == scene.sha256) {
        return Ok(());
    }
    Err(Failure::input(
        format!(
            "the daemon uses {}, not the scene {} given here",
            of_daemon
                .map_or_else(|| "no scene".into(), |scene| format!("its scene {}", scene.name)),
            scene.name
        ),
        "give the daemon's scene, or change its place.scene",
    ))
}
