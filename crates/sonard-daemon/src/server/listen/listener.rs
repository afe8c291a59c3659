//! Accepting side of an endpoint, whose listener can be bound late and replaced.

use std::{future::pending, io, net::IpAddr, sync::Arc};

use tokio::{
    net::{TcpListener, TcpStream, UnixListener, UnixStream},
    sync::watch,
};

/// Listener that the keeper publishes and replaces; `None` until it is bound.
#[derive(Debug)]
pub(in crate::server) struct DynamicListener<L>(watch::Receiver<Option<Arc<L>>>);

/// Connection with its remote address.
type Accepted<S> = (S, Option<IpAddr>);

impl<L> DynamicListener<L> {
    /// Creates a listener handle, and the sender by which the keeper replaces the listener.
    pub(super) fn new(first: Option<L>) -> (Self, watch::Sender<Option<Arc<L>>>) {
        let (sender, receiver) = watch::channel(first.map(Arc::new));
        (Self(receiver), sender)
    }

    /// Accepts by `accept` from the current listener, and switches to a new one as soon as it is
    /// published.
    async fn accept_by<T>(&self, accept: impl AsyncFn(&L) -> io::Result<T>) -> io::Result<T> {
        let mut current = self.0.clone();
        loop {
            let listener = current.borrow_and_update().clone();
            let accepted = async {
                match &listener {
                    Some(listener) => accept(listener).await,
                    None => pending().await,
                }
            };
            tokio::select! {
                accepted = accepted => return accepted,
                // If the keeper is gone, the last listener remains.
                Ok(()) = current.changed() => {}
            }
        }
    }
}

impl DynamicListener<UnixListener> {
    /// Accepts the next connection. Cancel-safe.
    pub(in crate::server) async fn accept(&self) -> io::Result<Accepted<UnixStream>> {
        self.accept_by(async |listener| listener.accept().await.map(|(stream, _)| (stream, None)))
            .await
    }
}

impl DynamicListener<TcpListener> {
    /// Accepts the next connection. Cancel-safe.
    pub(in crate::server) async fn accept(&self) -> io::Result<Accepted<TcpStream>> {
        let (stream, from) = self.accept_by(async |listener| listener.accept().await).await?;
        // Each line is sent without delay.
        stream.set_nodelay(true)?;
        Ok((stream, Some(from.ip())))
    }
}
