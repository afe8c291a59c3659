//! Sockets: those that systemd hands over, or those that the configuration names.

use std::{
    fs, io,
    net::SocketAddr,
    os::unix::{
        fs::{FileTypeExt as _, MetadataExt as _, PermissionsExt as _},
        net::UnixStream,
    },
    path::{Path, PathBuf},
};

use listenfd::ListenFd;
use thiserror::Error;
use tokio::net::{TcpListener, UnixListener};

use super::Peer;
use crate::config::ServerKeys;

const SOCKET: &str = "server.socket";
const LISTEN: &str = "server.listen";

/// Sockets that the server listens on.
#[derive(Debug, Default)]
pub struct Listeners {
    pub(super) unix: Vec<UnixListener>,
    pub(super) tcp: Vec<(TcpListener, Peer)>,
    /// Sockets to remove at the end.
    made: Vec<Made>,
}

/// A socket that this process made: its path, device and inode.
#[derive(Debug)]
struct Made {
    path: PathBuf,
    id: (u64, u64),
}

impl Made {
    fn at(path: PathBuf) -> io::Result<Self> {
        let there = fs::symlink_metadata(&path)?;
        Ok(Self { path, id: (there.dev(), there.ino()) })
    }

    /// Removes the socket, unless something else has taken its name.
    fn remove(&self) {
        let there = fs::symlink_metadata(&self.path);
        if there.is_ok_and(|there| (there.dev(), there.ino()) == self.id) {
            // Nothing more can be done about one that won't go.
            drop(fs::remove_file(&self.path));
        }
    }
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
            (Some(LISTEN), io::ErrorKind::AddrInUse) => {
                "another program listens on that port: stop it, or give this one another \
                 server.listen"
            }
            (Some(LISTEN), io::ErrorKind::AddrNotAvailable) => {
                "give server.listen an address of this computer, such as 127.0.0.1:8765"
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
    /// The sockets that systemd hands over, else those of the configuration. Must be called
    /// within a tokio runtime.
    ///
    /// # Errors
    /// When a socket can't be made, or another program listens there.
    pub fn open(keys: &ServerKeys) -> Result<Self, ListenError> {
        let mut listeners = Self::default();
        let fail = |key, place: &str| {
            let place = place.to_owned();
            move |source| ListenError { key, place, source }
        };
        listeners.take_inherited().map_err(fail(None, "the sockets of systemd"))?;
        if listeners.unix.is_empty() && !keys.socket.is_empty() {
            let path = PathBuf::from(&keys.socket);
            // Checked with the configuration; nothing wider than meant comes of a wrong one.
            let mode = keys.socket_permissions().unwrap_or(0o600);
            let bound = bind_unix(&path, mode).map_err(fail(Some(SOCKET), &keys.socket))?;
            listeners.unix.push(bound);
            listeners.made.push(Made::at(path).map_err(fail(Some(SOCKET), &keys.socket))?);
        }
        if let Some(address) = keys.listen.as_deref().filter(|_| listeners.tcp.is_empty()) {
            listeners.add_tcp(address).map_err(fail(Some(LISTEN), address))?;
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

    /// Removes the sockets that were made.
    pub(super) fn remove_made(&self) {
        self.made.iter().for_each(Made::remove);
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

/// Makes the socket; one that a dead process left behind is replaced, a living one is not, and
/// nothing else is touched.
fn bind_unix(path: &Path, mode: u32) -> io::Result<UnixListener> {
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(error),
        Ok(there) if !there.file_type().is_socket() => {
            let error = "there is a file of that name, which is no socket";
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, error));
        }
        Ok(_) => match UnixStream::connect(path) {
            Ok(_) => return Err(io::ErrorKind::AddrInUse.into()),
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => {
                fs::remove_file(path)?;
            }
            Err(error) => return Err(error),
        },
    }
    let listener = UnixListener::bind(path)?;
    fs::set_permissions(path, fs::Permissions::from_mode(mode))?;
    Ok(listener)
}
