//! A TCP address, which may not be this computer's yet.

use std::{io, net::SocketAddr, sync::Arc};

use tokio::{net::TcpListener, sync::watch};

use super::kept::Kept;

/// An address that is listened on as soon as it can be.
#[derive(Debug)]
pub(super) struct TcpPlace {
    address: SocketAddr,
    listener: watch::Sender<Option<Arc<TcpListener>>>,
}

impl TcpPlace {
    /// The place of this address, and why it could not be bound at once, if so. Must be called within a tokio runtime.
    ///
    /// # Errors
    /// When it can never be bound by this process.
    pub(super) fn open(
        address: SocketAddr,
    ) -> io::Result<(Self, Kept<TcpListener>, Option<io::Error>)> {
        let (listener, not_yet) = match bind(address) {
            Ok(listener) => (Some(listener), None),
            Err(error) if is_lasting(&error) => return Err(error),
            Err(error) => (None, Some(error)),
        };
        let (kept, sender) = Kept::new(listener);
        Ok((Self { address, listener: sender }, kept, not_yet))
    }

    /// A listener that systemd has bound.
    ///
    /// # Errors
    /// When its address is not known.
    pub(super) fn inherited(listener: TcpListener) -> io::Result<(Self, Kept<TcpListener>)> {
        let address = listener.local_addr()?;
        let (kept, sender) = Kept::new(Some(listener));
        Ok((Self { address, listener: sender }, kept))
    }

    /// The address as configured.
    pub(super) const fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address that is listened on, if one is.
    pub(super) fn bound(&self) -> Option<SocketAddr> {
        self.listener.borrow().as_ref().and_then(|listener| listener.local_addr().ok())
    }

    /// Tries again to bind an address that is not bound; whether it is bound by this call.
    ///
    /// # Errors
    /// As the system reports.
    pub(super) fn look(&self) -> io::Result<bool> {
        if self.listener.borrow().is_some() {
            return Ok(false);
        }
        self.listener.send_replace(Some(Arc::new(bind(self.address)?)));
        Ok(true)
    }
}

fn bind(address: SocketAddr) -> io::Result<TcpListener> {
    let listener = std::net::TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    TcpListener::from_std(listener)
}

/// Whether no later try of the same process can succeed: no address appears and no other program ends that would change it.
fn is_lasting(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::InvalidInput)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_port_that_is_taken_is_bound_once_it_is_free() {
        let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = taken.local_addr().expect("an address");
        let (place, kept, not_yet) = TcpPlace::open(address).expect("it may be tried");
        assert_eq!(not_yet.map(|error| error.kind()), Some(io::ErrorKind::AddrInUse));
        assert_eq!(place.bound(), None);
        assert!(place.look().is_err());
        drop(taken);
        assert!(place.look().expect("it is free"));
        assert!(!place.look().expect("it is bound"));
        assert_eq!(place.bound(), Some(address));
        let _client = std::net::TcpStream::connect(address).expect("it listens");
        kept.accept().await.expect("a connection");
    }

    #[tokio::test]
    async fn an_address_of_another_computer_may_be_assigned_later() {
        // TEST-NET-1 of RFC 5737: no computer's.
        let address = "192.0.2.1:0".parse().expect("an address");
        let (place, _kept, not_yet) = TcpPlace::open(address).expect("it may be tried");
        assert_eq!(not_yet.map(|error| error.kind()), Some(io::ErrorKind::AddrNotAvailable));
        assert_eq!((place.bound(), place.address()), (None, address));
    }
}
