//! Listening sockets, inherited from systemd or opened by the configuration.

mod keeper;
mod listener;
mod tcp;
mod unix;

use std::{io, net::SocketAddr, path::Path};

use listenfd::ListenFd;
use sonard_api::config::ServerKeys;
use thiserror::Error;
use tokio::{
    io::DuplexStream,
    net::{TcpListener, UnixListener},
    sync::mpsc::UnboundedReceiver,
};

use super::Peer;

pub(super) use keeper::Keeper;
pub(super) use listener::DynamicListener;
use tcp::TcpEndpoint;
use unix::UnixEndpoint;

const SOCKET: &str = "server.socket";
const LISTEN: &str = "server.listen";

/// Endpoints of the server, some of which may be bound later. Socket files created by this process
/// are removed when it exits.
#[derive(Debug, Default)]
pub struct Listeners {
    pub(super) unix: Vec<DynamicListener<UnixListener>>,
    pub(super) tcp: Vec<(DynamicListener<TcpListener>, Peer)>,
    pub(super) memory: Option<UnboundedReceiver<(DuplexStream, Peer)>>,
    pub(super) keeper: Keeper,
}

/// Socket that can't be opened.
#[derive(Debug, Error)]
#[error("cannot listen on {place}: {source}")]
pub struct ListenError {
    /// Configuration key of the socket; `None` for sockets inherited from systemd.
    pub key: Option<&'static str>,
    /// Path or address.
    pub place: String,
    /// System error.
    pub source: io::Error,
}

impl ListenError {
    /// Returns advice on how to resolve the error.
    #[must_use]
    pub fn help(&self) -> &'static str {
        match (self.key, self.source.kind()) {
            (Some(SOCKET), io::ErrorKind::AddrInUse) => {
                "another sonard daemon uses this socket: stop it, or set another server.socket"
            }
            (Some(SOCKET), io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied) => {
                "give --socket (server.socket) a path in a writable folder, or set it to an empty text \
                 for no socket"
            }
            (Some(SOCKET), io::ErrorKind::AlreadyExists) => {
                "only the stale socket of an exited daemon is replaced: set server.socket to an unused \
                 path"
            }
            (Some(LISTEN), io::ErrorKind::PermissionDenied) => {
                "ports below 1024 need privileges: set a higher port in server.listen"
            }
            (Some(LISTEN), _) => "see server.listen",
            (Some(_), _) => "see server.socket",
            (None, _) => "check the systemd socket unit: it must pass stream sockets",
        }
    }
}

impl Listeners {
    /// Returns listeners without sockets: connections are the server's ends of pipes in memory,
    /// each with the kind of client at the other end.
    #[must_use]
    pub fn in_memory(connections: UnboundedReceiver<(DuplexStream, Peer)>) -> Self {
        Self { memory: Some(connections), ..Self::default() }
    }

    /// Opens the sockets inherited from systemd, or else those of the configuration. An address not
    /// assigned yet or a port in use is bound later. Must be called within a tokio runtime.
    ///
    /// # Errors
    /// Unix socket that can't be created or is in use by another program, or an address that can
    /// never be bound.
    pub fn open(keys: &ServerKeys) -> Result<Self, ListenError> {
        let mut listeners = Self::default();
        let fail = |key, place: &str| {
            let place = place.to_owned();
            move |source| ListenError { key, place, source }
        };
        listeners.take_inherited().map_err(fail(None, "the sockets of systemd"))?;
        if listeners.unix.is_empty() && !keys.socket.is_empty() {
            // The configuration has been validated; the fallback grants the least permissions.
            let mode = keys.socket_permissions().unwrap_or(0o600);
            let bound = UnixEndpoint::bind(Path::new(&keys.socket), mode);
            let (endpoint, listener) = bound.map_err(fail(Some(SOCKET), &keys.socket))?;
            listeners.unix.push(listener);
            listeners.keeper.unix.push(endpoint);
        }
        if let Some(address) = keys.listen.as_deref().filter(|_| listeners.tcp.is_empty()) {
            listeners.add_tcp(address).map_err(fail(Some(LISTEN), address))?;
        }
        Ok(listeners)
    }

    /// Returns the TCP addresses, including those not bound yet.
    #[must_use]
    pub fn addresses(&self) -> Vec<SocketAddr> {
        self.keeper.tcp.iter().map(TcpEndpoint::address).collect()
    }

    fn take_inherited(&mut self) -> io::Result<()> {
        let mut handed = ListenFd::from_env();
        for at in 0..handed.len() {
            if let Ok(Some(listener)) = handed.take_unix_listener(at) {
                listener.set_nonblocking(true)?;
                let (endpoint, listener) =
                    UnixEndpoint::inherited(UnixListener::from_std(listener)?);
                self.unix.push(listener);
                self.keeper.unix.extend(endpoint);
            } else if let Ok(Some(listener)) = handed.take_tcp_listener(at) {
                listener.set_nonblocking(true)?;
                let (endpoint, listener) =
                    TcpEndpoint::inherited(TcpListener::from_std(listener)?)?;
                self.add(endpoint, listener);
            }
        }
        Ok(())
    }

    fn add_tcp(&mut self, address: &str) -> io::Result<()> {
        let address: SocketAddr = address.parse().map_err(|_| {
            io::Error::new(
                io::ErrorKind::InvalidInput,
                "expected an address such as 127.0.0.1:8765",
            )
        })?;
        let (endpoint, listener, error) = TcpEndpoint::open(address)?;
        if let Some(error) = error {
            let name = format!("{LISTEN} {address}");
            let why = format!("cannot be bound yet: {error}");
            keeper::report_trouble(&mut self.keeper.troubles, name, why);
        }
        self.add(endpoint, listener);
        Ok(())
    }

    fn add(&mut self, endpoint: TcpEndpoint, listener: DynamicListener<TcpListener>) {
        endpoint.announce();
        let is_loopback = endpoint.address().ip().is_loopback();
        self.tcp.push((listener, if is_loopback { Peer::Loopback } else { Peer::Network }));
        self.keeper.tcp.push(endpoint);
    }
}
