//! Sockets, as far as they differ between Linux and macOS.

use std::{io, os::unix::net::SocketAddr};

/// Address of a socket without a file, by its name.
///
/// # Errors
/// Returns an error for a name that is too long.
#[cfg(target_os = "linux")]
pub(crate) fn abstract_address(name: &[u8]) -> io::Result<SocketAddr> {
    use std::os::linux::net::SocketAddrExt as _;
    SocketAddr::from_abstract_name(name)
}

/// Fails: sockets without a file exist on Linux only.
#[cfg(not(target_os = "linux"))]
pub(crate) fn abstract_address(_name: &[u8]) -> io::Result<SocketAddr> {
    Err(io::ErrorKind::Unsupported.into())
}
