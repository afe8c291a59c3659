//! Sockets: those that systemd hands over, or those that the configuration names.

use std::{
    fs, io,
    net::SocketAddr,
    os::unix::{fs::PermissionsExt as _, net::UnixStream},
    path::{Path, PathBuf},
};

use listenfd::ListenFd;
use thiserror::Error;
use tokio::net::{TcpListener, UnixListener};

use super::Peer;
use crate::config::ServerKeys;

/// Sockets that the server listens on.
#[derive(Debug, Default)]
pub struct Listeners {
    pub(super) unix: Vec<UnixListener>,
    pub(super) tcp: Vec<(TcpListener, Peer)>,
    /// Files to remove at the end.
    pub(super) made: Vec<PathBuf>,
}

/// Why a socket can't be had.
#[derive(Debug, Error)]
#[error("cannot listen on {place}: {source}")]
pub struct ListenError {
    /// The path or address.
    pub place: String,
    /// What the system says.
    pub source: io::Error,
}

impl ListenError {
    /// What a person can do about it.
    #[must_use]
    pub fn help(&self) -> &'static str {
        match self.source.kind() {
            io::ErrorKind::AddrInUse => {
                "another sonard listens there: stop it, or give this one another server.socket"
            }
            io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied => {
                "give server.socket in a folder that exists and that you may write to, or an \
                 empty one for no socket"
            }
            _ => "see server.socket and server.listen",
        }
    }
}

impl Listeners {
    /// The sockets that systemd hands over, else those of the configuration. Must be called
    /// within a tokio runtime.
    ///
    /// # Errors
    /// When a socket can't be made, or another program listens there.
    pub fn open(keys: &ServerKeys) -> Result<Self, ListenError> {
        let mut listeners = Self::default();
        let fail = |place: &str| {
            let place = place.to_owned();
            move |source| ListenError { place, source }
        };
        listeners.take_inherited().map_err(fail("the sockets of systemd"))?;
        if listeners.unix.is_empty() && !keys.socket.is_empty() {
            let path = PathBuf::from(&keys.socket);
            let mode = u32::from_str_radix(&keys.socket_mode, 8).unwrap_or(0o600);
            listeners.unix.push(bind_unix(&path, mode).map_err(fail(&keys.socket))?);
            listeners.made.push(path);
        }
        if let Some(address) = keys.listen.as_deref().filter(|_| listeners.tcp.is_empty()) {
            listeners.add_tcp(address).map_err(fail(address))?;
        }
        Ok(listeners)
    }

    /// TCP addresses that are listened on.
    ///
    /// # Errors
    /// As the system says.
    pub fn addresses(&self) -> io::Result<Vec<SocketAddr>> {
        self.tcp.iter().map(|(listener, _)| listener.local_addr()).collect()
    }

    fn take_inherited(&mut self) -> io::Result<()> {
        let mut handed = ListenFd::from_env();
        for at in 0..handed.len() {
            if let Ok(Some(listener)) = handed.take_unix_listener(at) {
                listener.set_nonblocking(true)?;
                self.unix.push(UnixListener::from_std(listener)?);
            } else if let Ok(Some(listener)) = handed.take_tcp_listener(at) {
                listener.set_nonblocking(true)?;
                let peer = peer(listener.local_addr()?);
                self.tcp.push((TcpListener::from_std(listener)?, peer));
            }
        }
        Ok(())
    }

    fn add_tcp(&mut self, address: &str) -> io::Result<()> {
        let address: SocketAddr = address.parse().map_err(|_| {
            io::Error::new(io::ErrorKind::InvalidInput, "not an address such as 127.0.0.1:8765")
        })?;
        let listener = std::net::TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        self.tcp.push((TcpListener::from_std(listener)?, peer(address)));
        Ok(())
    }
}

fn peer(address: SocketAddr) -> Peer {
    if address.ip().is_loopback() { Peer::Loopback } else { Peer::Network }
}

/// Makes the socket; one that a dead process left behind is replaced, a living one is not.
fn bind_unix(path: &Path, mode: u32) -> io::Result<UnixListener> {
    if path.exists() {
        match UnixStream::connect(path) {
            Ok(_) => return Err(io::ErrorKind::AddrInUse.into()),
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => {
                fs::remove_file(path)?;
            }
            Err(error) => return Err(error),
        }
    }
    let listener = UnixListener::bind(path)?;
    fs::set_permissions(path, fs::Permissions::from_mode(mode))?;
    Ok(listener)
}
