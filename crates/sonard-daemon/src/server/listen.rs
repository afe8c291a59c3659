//! Sockets: those that systemd hands over, or those that the configuration names.

mod keeper;
mod kept;
mod tcp;
mod unix;

use std::{io, net::SocketAddr, path::Path};

use listenfd::ListenFd;
use sonard_api::config::ServerKeys;
use thiserror::Error;
use tokio::net::{TcpListener, UnixListener};

use super::Peer;

pub(super) use keeper::Keeper;
pub(super) use kept::Kept;
use tcp::TcpPlace;
use unix::UnixPlace;

const SOCKET: &str = "server.socket";
const LISTEN: &str = "server.listen";

/// Places that the server listens at, now or as soon as they can be bound. Socket files that this process made are
/// removed with it.
#[derive(Debug, Default)]
pub struct Listeners {
    pub(super) unix: Vec<Kept<UnixListener>>,
    pub(super) tcp: Vec<(Kept<TcpListener>, Peer)>,
    pub(super) keeper: Keeper,
}

/// A socket that can't be opened.
#[derive(Debug, Error)]
#[error("cannot listen on {place}: {source}")]
pub struct ListenError {
    /// The key that names it; `None` for sockets that systemd hands over.
    pub key: Option<&'static str>,
    /// The path or address.
    pub place: String,
    /// What the system says.
    pub source: io::Error,
}

impl ListenError {
    /// What a person can do about it.
    #[must_use]
    pub fn help(&self) -> &'static str {
        match (self.key, self.source.kind()) {
            (Some(SOCKET), io::ErrorKind::AddrInUse) => {
                "another sonard listens there: stop it, or give this one another server.socket"
            }
            (Some(SOCKET), io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied) => {
                "give server.socket in a folder that exists and that you may write to, or an \
                 empty one for no socket"
            }
            (Some(SOCKET), io::ErrorKind::AlreadyExists) => {
                "only a socket that a dead sonard left behind is replaced: give server.socket a name \
                 of its own"
            }
            (Some(LISTEN), io::ErrorKind::PermissionDenied) => {
                "ports below 1024 are the system's: give server.listen a higher one"
            }
            (Some(LISTEN), _) => "see server.listen",
            (Some(_), _) => "see server.socket",
            (None, _) => "see the socket unit: it hands over stream sockets",
        }
    }
}

impl Listeners {
    /// The sockets that systemd hands over, else those of the configuration. An address that is not this computer's yet,
    /// or a port that is in use, is bound later. Must be called within a tokio runtime.
    ///
    /// # Errors
    /// When a unix socket can't be made or another program listens there, or the address can never be bound.
    pub fn open(keys: &ServerKeys) -> Result<Self, ListenError> {
        let mut listeners = Self::default();
        let fail = |key, place: &str| {
            let place = place.to_owned();
            move |source| ListenError { key, place, source }
        };
        listeners.take_inherited().map_err(fail(None, "the sockets of systemd"))?;
        if listeners.unix.is_empty() && !keys.socket.is_empty() {
            // Checked with the configuration; nothing wider than meant comes of a wrong one.
            let mode = keys.socket_permissions().unwrap_or(0o600);
            let bound = UnixPlace::bind(Path::new(&keys.socket), mode);
            let (place, kept) = bound.map_err(fail(Some(SOCKET), &keys.socket))?;
            listeners.unix.push(kept);
            listeners.keeper.unix.push(place);
        }
        if let Some(address) = keys.listen.as_deref().filter(|_| listeners.tcp.is_empty()) {
            listeners.add_tcp(address).map_err(fail(Some(LISTEN), address))?;
        }
        Ok(listeners)
    }

    /// TCP addresses that are, or are to be, listened on.
    #[must_use]
    pub fn addresses(&self) -> Vec<SocketAddr> {
        self.keeper.tcp.iter().map(TcpPlace::address).collect()
    }

    fn take_inherited(&mut self) -> io::Result<()> {
        let mut handed = ListenFd::from_env();
        for at in 0..handed.len() {
            if let Ok(Some(listener)) = handed.take_unix_listener(at) {
                listener.set_nonblocking(true)?;
                let (place, kept) = UnixPlace::inherited(UnixListener::from_std(listener)?);
                self.unix.push(kept);
                self.keeper.unix.extend(place);
            } else if let Ok(Some(listener)) = handed.take_tcp_listener(at) {
                listener.set_nonblocking(true)?;
                let (place, kept) = TcpPlace::inherited(TcpListener::from_std(listener)?)?;
                self.add(place, kept);
            }
        }
        Ok(())
    }

    fn add_tcp(&mut self, address: &str) -> io::Result<()> {
        let address: SocketAddr = address.parse().map_err(|_| {
            io::Error::new(io::ErrorKind::InvalidInput, "not an address such as 127.0.0.1:8765")
        })?;
        let (place, kept, not_yet) = TcpPlace::open(address)?;
        if let Some(error) = not_yet {
            let name = format!("{LISTEN} {address}");
            let why = format!("cannot be bound yet: {error}");
            keeper::note(&mut self.keeper.troubles, name, why);
        }
        self.add(place, kept);
        Ok(())
    }

    fn add(&mut self, place: TcpPlace, kept: Kept<TcpListener>) {
        place.announce();
        let is_loopback = place.address().ip().is_loopback();
        self.tcp.push((kept, if is_loopback { Peer::Loopback } else { Peer::Network }));
        self.keeper.tcp.push(place);
    }
}
