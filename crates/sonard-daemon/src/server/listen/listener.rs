//! The accepting side of a place: the listener there may be bound late and be replaced.

use std::{future::pending, io, net::IpAddr, sync::Arc};

use tokio::{
    net::{TcpListener, TcpStream, UnixListener, UnixStream},
    sync::watch,
};

/// The listener of a place as its keeper publishes it; `None` until it is bound.
#[derive(Debug)]
pub(in crate::server) struct Kept<L>(watch::Receiver<Option<Arc<L>>>);

/// A connection and the address that it came from.
type Accepted<S> = (S, Option<IpAddr>);

impl<L> Kept<L> {
    /// A place with this listener, and the end by which its keeper replaces it.
    pub(super) fn new(first: Option<L>) -> (Self, watch::Sender<Option<Arc<L>>>) {
        let (sender, receiver) = watch::channel(first.map(Arc::new));
        (Self(receiver), sender)
    }

    /// Accepts from the current listener by `accept`, from another one as soon as there is one.
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
                // Without a keeper the last listener stays.
                Ok(()) = current.changed() => {}
            }
        }
    }
}

impl Kept<UnixListener> {
    /// The next connection. Cancel-safe.
    pub(in crate::server) async fn accept(&self) -> io::Result<Accepted<UnixStream>> {
        self.accept_by(async |listener| listener.accept().await.map(|(stream, _)| (stream, None)))
            .await
    }
}

impl Kept<TcpListener> {
    /// The next connection. Cancel-safe.
    pub(in crate::server) async fn accept(&self) -> io::Result<Accepted<TcpStream>> {
        let (stream, from) = self.accept_by(async |listener| listener.accept().await).await?;
        // Each line goes out at once.
        stream.set_nodelay(true)?;
        Ok((stream, Some(from.ip())))
    }
}
