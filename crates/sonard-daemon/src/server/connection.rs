//! Accepts connections up to a limit, serves them with timeouts, and shuts them down.

use std::{
    error::Error as _,
    future::{Future, pending},
    io,
    net::IpAddr,
    pin::pin,
    sync::Arc,
    time::Duration,
};

use axum::extract::Request;
use hyper::{body::Incoming, server::conn::http1, service::service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use sonard_runtime::supervisor::Task;
use tokio::{
    io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _},
    sync::OwnedSemaphorePermit,
    task::JoinSet,
    time::{sleep, timeout},
};
use tokio_io_timeout::TimeoutStream;
use tokio_util::sync::CancellationToken;
use tower::ServiceExt as _;

use super::{Listeners, Peer, Server, error_body::ErrorBodyStream, limits::ConnectionSlot};

/// Time limit for the head of a request.
const HEAD_TIMEOUT: Duration = Duration::from_secs(5);
/// Time limit for the request of a rejected client.
const REJECTED_TIMEOUT: Duration = Duration::from_millis(500);
/// Time for clients to read pending data at shutdown.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(2);
/// Buffer size of a connection, bytes: request heads and unread responses.
const BUFFER_BYTES: usize = 32 * 1024;

impl Server {
    /// Serves until `stop` completes, then lets pending requests finish.
    pub async fn run(self, listeners: Listeners, stop: impl Future<Output = ()>) {
        let shutdown = CancellationToken::new();
        let foxglove = self.foxglove.clone();
        let supervisor = self.daemon.supervisor().clone();
        let server = Arc::new(self);
        let mut accepting = Vec::new();
        let Listeners { unix, tcp, memory, keeper } = listeners;
        for listener in unix {
            let server = Arc::clone(&server);
            let accept = server.accept(shutdown.clone(), async move || {
                let (stream, address) = listener.accept().await?;
                Ok((stream, Peer::Unix, address))
            });
            accepting.push(supervisor.spawn(Task::Server, accept));
        }
        for (listener, peer) in tcp {
            let server = Arc::clone(&server);
            let accept = server.accept(shutdown.clone(), async move || {
                let (stream, address) = listener.accept().await?;
                Ok((stream, peer, address))
            });
            accepting.push(supervisor.spawn(Task::Server, accept));
        }
        if let Some(mut connections) = memory {
            let server = Arc::clone(&server);
            let accept =
                server.accept(shutdown.clone(), async move || match connections.recv().await {
                    Some((stream, peer)) => Ok((stream, peer, None)),
                    None => pending().await,
                });
            accepting.push(supervisor.spawn(Task::Server, accept));
        }
        let keeping = keeper.run(server.daemon.clone(), shutdown.clone());
        accepting.push(supervisor.spawn(Task::Listeners, keeping));
        stop.await;
        shutdown.cancel();
        for accept in accepting {
            drop(accept.await);
        }
        if let Some(viewers) = foxglove {
            drop(timeout(DRAIN_TIMEOUT, viewers.is_empty()).await);
        }
    }

    /// Accepts connections until shutdown, then waits for them to end.
    async fn accept<S: AsyncRead + AsyncWrite + Send + 'static>(
        self: Arc<Self>,
        shutdown: CancellationToken,
        mut next: impl AsyncFnMut() -> io::Result<(S, Peer, Option<IpAddr>)>,
    ) {
        let mut connections = JoinSet::new();
        loop {
            let accepted = tokio::select! {
                () = shutdown.cancelled() => break,
                Some(_) = connections.join_next(), if !connections.is_empty() => continue,
                accepted = next() => accepted,
            };
            let Ok((stream, peer, address)) = accepted else {
                // Out of file descriptors: retry once others are closed.
                sleep(Duration::from_millis(100)).await;
                continue;
            };
            if let Some(slot) = self.slots.take(peer, address) {
                let server = Arc::clone(&self);
                connections.spawn(server.serve(peer, stream, slot, shutdown.clone()));
            } else if let Ok(permit) = Arc::clone(&self.rejecting_slots).try_acquire_owned() {
                connections.spawn(reject_over_limit(stream, permit));
            }
        }
        drop(
            timeout(DRAIN_TIMEOUT, async { while connections.join_next().await.is_some() {} })
                .await,
        );
    }

    async fn serve<S: AsyncRead + AsyncWrite + Send + 'static>(
        self: Arc<Self>,
        peer: Peer,
        stream: S,
        slot: ConnectionSlot,
        shutdown: CancellationToken,
    ) {
        // An upgraded connection keeps the slot.
        let slot = Arc::new(slot);
        let mut stream = TimeoutStream::new(stream);
        stream.set_write_timeout(Some(self.stall));
        let service = service_fn(|mut request: Request<Incoming>| {
            request.extensions_mut().insert(peer);
            request.extensions_mut().insert(Arc::clone(&slot));
            let router = self.router.clone();
            router.oneshot(request)
        });
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEAD_TIMEOUT)
            .max_buf_size(BUFFER_BYTES)
            .serve_connection(TokioIo::new(ErrorBodyStream::new(Box::pin(stream))), service)
            .with_upgrades();
        let mut connection = pin!(connection);
        let ended = tokio::select! {
            ended = &mut connection => ended,
            () = shutdown.cancelled() => {
                connection.as_mut().graceful_shutdown();
                connection.await
            }
        };
        if let Err(error) = ended
            && is_write_timeout(&error)
        {
            self.daemon.hub().count_cut_off();
        }
    }
}

/// Responds 503 on a connection over the limit.
async fn reject_over_limit<S: AsyncRead + AsyncWrite>(stream: S, _permit: OwnedSemaphorePermit) {
    const BODY: &str =
        "{\"error\":\"too many clients\",\"help\":\"try later, or raise server.max_clients\"}\n";
    let response = format!(
        "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/json\r\n\
         X-Content-Type-Options: nosniff\r\nCache-Control: no-store\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\nRetry-After: 5\r\n\
         Content-Length: {}\r\n\r\n{BODY}",
        BODY.len()
    );
    let mut stream = pin!(stream);
    // A client that can't read even this response is dropped.
    drop(timeout(HEAD_TIMEOUT, stream.write_all(response.as_bytes())).await);
    // Closing before the request has arrived would reset the connection, and with it the response.
    let request = async {
        stream.shutdown().await?;
        tokio::io::copy(&mut stream.take(BUFFER_BYTES as u64), &mut tokio::io::sink()).await
    };
    drop(timeout(REJECTED_TIMEOUT, request).await);
}

/// Returns `true` if a connection ended because the client did not read.
fn is_write_timeout(error: &hyper::Error) -> bool {
    let io = error.source().and_then(|source| source.downcast_ref::<io::Error>());
    io.is_some_and(|error| error.kind() == io::ErrorKind::TimedOut)
}
