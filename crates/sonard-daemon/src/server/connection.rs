//! Connections: taken in up to a bound, each with its own limits, ended in order.

use std::{
    error::Error as _, future::Future, io, net::IpAddr, pin::pin, sync::Arc, time::Duration,
};

use axum::extract::Request;
use hyper::{body::Incoming, server::conn::http1, service::service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use sonard_runtime::supervisor::Task;
use tokio::{
    io::{AsyncRead, AsyncWrite, AsyncWriteExt as _},
    sync::OwnedSemaphorePermit,
    task::JoinSet,
    time::{sleep, timeout},
};
use tokio_io_timeout::TimeoutStream;
use tokio_util::sync::CancellationToken;
use tower::ServiceExt as _;

use super::{Listeners, Peer, Server, plain::Worded, slots::Slot};

/// How long the head of a request may take.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// How long clients have to take in what is left at the end.
const LAST_CALL: Duration = Duration::from_secs(2);
/// What is kept of a connection in memory, bytes: heads, and answers not yet taken.
const BUFFER: usize = 32 * 1024;

impl Server {
    /// Serves until `stop` is ready, then lets requests under way end.
    pub async fn run(self, listeners: Listeners, stop: impl Future<Output = ()>) {
        let shutdown = CancellationToken::new();
        let foxglove = self.foxglove.clone();
        let supervisor = self.daemon.supervisor().clone();
        let server = Arc::new(self);
        let mut accepting = Vec::new();
        let Listeners { unix, tcp, keeper } = listeners;
        for kept in unix {
            let server = Arc::clone(&server);
            let accept =
                server.accept(Peer::Unix, shutdown.clone(), async move || kept.accept().await);
            accepting.push(supervisor.spawn(Task::Server, accept));
        }
        for (kept, peer) in tcp {
            let server = Arc::clone(&server);
            let accept = server.accept(peer, shutdown.clone(), async move || kept.accept().await);
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
            drop(timeout(LAST_CALL, viewers.is_empty()).await);
        }
    }

    /// Takes connections in until the end, and waits for them then.
    async fn accept<S: AsyncRead + AsyncWrite + Send + 'static>(
        self: Arc<Self>,
        peer: Peer,
        shutdown: CancellationToken,
        next: impl AsyncFn() -> io::Result<(S, Option<IpAddr>)>,
    ) {
        let mut connections = JoinSet::new();
        loop {
            let came = tokio::select! {
                () = shutdown.cancelled() => break,
                Some(_) = connections.join_next(), if !connections.is_empty() => continue,
                came = next() => came,
            };
            let Ok((stream, address)) = came else {
                // No descriptors left: some will be given back.
                sleep(Duration::from_millis(100)).await;
                continue;
            };
            if let Some(place) = self.places.take(peer, address) {
                let server = Arc::clone(&self);
                connections.spawn(server.serve(peer, stream, place, shutdown.clone()));
            } else if let Ok(place) = Arc::clone(&self.doorstep).try_acquire_owned() {
                connections.spawn(turn_away(stream, place));
            }
        }
        drop(timeout(LAST_CALL, async { while connections.join_next().await.is_some() {} }).await);
    }

    async fn serve<S: AsyncRead + AsyncWrite + Send + 'static>(
        self: Arc<Self>,
        peer: Peer,
        stream: S,
        place: Slot,
        shutdown: CancellationToken,
    ) {
        // What is made of the connection later keeps its place.
        let place = Arc::new(place);
        let mut stream = TimeoutStream::new(stream);
        stream.set_write_timeout(Some(self.stall));
        let service = service_fn(|mut request: Request<Incoming>| {
            request.extensions_mut().insert(peer);
            request.extensions_mut().insert(Arc::clone(&place));
            let router = self.router.clone();
            router.oneshot(request)
        });
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEAD_TIME)
            .max_buf_size(BUFFER)
            .serve_connection(TokioIo::new(Worded::new(Box::pin(stream))), service)
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
            && took_nothing(&error)
        {
            self.daemon.hub().count_cut_off();
        }
    }
}

/// Says that all places are taken.
async fn turn_away<S: AsyncRead + AsyncWrite>(stream: S, _place: OwnedSemaphorePermit) {
    const BODY: &str =
        "{\"error\":\"too many clients\",\"help\":\"try later, or raise server.max_clients\"}\n";
    let answer = format!(
        "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/json\r\n\
         X-Content-Type-Options: nosniff\r\nCache-Control: no-store\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\nRetry-After: 5\r\n\
         Content-Length: {}\r\n\r\n{BODY}",
        BODY.len()
    );
    let mut stream = pin!(stream);
    // Whoever can't take even this is gone.
    drop(timeout(HEAD_TIME, stream.write_all(answer.as_bytes())).await);
}

/// Whether a connection ended because the client did not read.
fn took_nothing(error: &hyper::Error) -> bool {
    let io = error.source().and_then(|source| source.downcast_ref::<io::Error>());
    io.is_some_and(|error| error.kind() == io::ErrorKind::TimedOut)
}
