//! TCP endpoint, whose address may not be assigned to this computer yet.

use std::{io, net::SocketAddr, sync::Arc};

use tokio::{net::TcpListener, sync::watch};

use super::listener::DynamicListener;

/// TCP address that is bound as soon as possible.
#[derive(Debug)]
pub(super) struct TcpEndpoint {
    address: SocketAddr,
    listener: watch::Sender<Option<Arc<TcpListener>>>,
}

impl TcpEndpoint {
    /// Creates the endpoint; a transient error of the first attempt to bind is returned alongside.
    /// Must be called within a tokio runtime.
    ///
    /// # Errors
    /// Address that this process can never bind.
    pub(super) fn open(
        address: SocketAddr,
    ) -> io::Result<(Self, DynamicListener<TcpListener>, Option<io::Error>)> {
        let (listener, error) = match bind(address) {
            Ok(listener) => (Some(listener), None),
            Err(error) if is_permanent(&error) => return Err(error),
            Err(error) => (None, Some(error)),
        };
        let (listener_handle, sender) = DynamicListener::new(listener);
        Ok((Self { address, listener: sender }, listener_handle, error))
    }

    /// Creates the endpoint of a listener bound by systemd.
    ///
    /// # Errors
    /// Listener without a known address.
    pub(super) fn inherited(
        listener: TcpListener,
    ) -> io::Result<(Self, DynamicListener<TcpListener>)> {
        let address = listener.local_addr()?;
        let (listener_handle, sender) = DynamicListener::new(Some(listener));
        Ok((Self { address, listener: sender }, listener_handle))
    }

    /// Configured address.
    pub(super) const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Bound address, if any.
    pub(super) fn bound(&self) -> Option<SocketAddr> {
        self.listener.borrow().as_ref().and_then(|listener| listener.local_addr().ok())
    }

    /// Retries to bind an unbound address. Returns `true` if this call has bound it.
    ///
    /// # Errors
    /// System error of the attempt.
    pub(super) fn check(&self) -> io::Result<bool> {
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

/// Returns `true` if no later attempt can succeed, even if addresses are assigned or other programs
/// exit.
fn is_permanent(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::InvalidInput)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn busy_port_is_bound_later() {
        let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = taken.local_addr().expect("an address");
        let (endpoint, listener_handle, error) = TcpEndpoint::open(address).expect("transient");
        assert_eq!(error.map(|error| error.kind()), Some(io::ErrorKind::AddrInUse));
        assert_eq!(endpoint.bound(), None);
        assert!(endpoint.check().is_err());
        drop(taken);
        assert!(endpoint.check().expect("port is free"));
        assert!(!endpoint.check().expect("port is bound"));
        assert_eq!(endpoint.bound(), Some(address));
        let _client = std::net::TcpStream::connect(address).expect("connects");
        listener_handle.accept().await.expect("a connection");
    }

    #[tokio::test]
    async fn unassigned_address_is_transient() {
        // TEST-NET-1 of RFC 5737 is assigned to no computer.
        let address = "192.0.2.1:0".parse().expect("an address");
        let (endpoint, _listener_handle, error) = TcpEndpoint::open(address).expect("transient");
        assert_eq!(error.map(|error| error.kind()), Some(io::ErrorKind::AddrNotAvailable));
        assert_eq!((endpoint.bound(), endpoint.address()), (None, address));
    }
}
