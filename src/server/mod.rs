//! The HTTP API, on a unix socket and on loopback TCP.
//!
//! Everything a client can do to the server is bounded: connections, requests a second, size and
//! time of a request, time without reading. A client that hits a bound loses its connection; the
//! operator, who measures, is a task of its own and never waits for a client.

mod access;
mod answer;
mod connection;
mod listen;
mod openapi;
mod rate;
mod routes;

use std::{
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use axum::{
    Router,
    extract::{DefaultBodyLimit, Request, State},
    http::{HeaderValue, StatusCode, header},
    middleware::{self, Next},
    response::{IntoResponse, Response},
};
use serde_json::Value;
use tokio::{sync::Semaphore, time::Instant};
use tower_http::{
    catch_panic::CatchPanicLayer, set_header::SetResponseHeaderLayer, timeout::TimeoutLayer,
};

pub use access::{Access, Peer, Refused};
pub use answer::{Accepted, Problem};
pub use listen::{ListenError, Listeners};

use crate::{config::ServerKeys, daemon::Handle, store::History};
use answer::Failed;
use rate::Bucket;

/// How long a request may take until its answer begins.
const REQUEST_TIME: Duration = Duration::from_secs(10);

/// What every handler knows.
#[derive(Clone)]
pub(crate) struct Api {
    daemon: Handle,
    log_folder: Arc<PathBuf>,
    document: Arc<Value>,
    access: Arc<Access>,
    history: Arc<Mutex<History>>,
    /// Who asks the model about a beam.
    looking: Arc<Semaphore>,
    bucket: Arc<Mutex<Bucket>>,
    epoch: Instant,
}

/// The server, before it has sockets.
pub struct Server {
    router: Router,
    daemon: Handle,
    places: Arc<Semaphore>,
    stall: Duration,
}

impl Server {
    /// A server of `daemon`, whose logs are in `log_folder`.
    #[must_use]
    pub fn new(daemon: Handle, log_folder: PathBuf, access: Access, keys: &ServerKeys) -> Self {
        let endpoints = routes::endpoints();
        let api = Api {
            daemon: daemon.clone(),
            history: Arc::new(Mutex::new(History::new(log_folder.clone()))),
            looking: Arc::new(Semaphore::new(1)),
            log_folder: Arc::new(log_folder),
            document: Arc::new(openapi::document(&endpoints)),
            access: Arc::new(access),
            bucket: Arc::new(Mutex::new(Bucket::new(keys.max_requests_per_s))),
            epoch: Instant::now(),
        };
        let nosniff = (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
        let uncached = (header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        let router = openapi::router(endpoints)
            .fallback(nothing_here)
            .method_not_allowed_fallback(other_method)
            .layer(DefaultBodyLimit::max(keys.max_body_kb as usize * 1000))
            .layer(TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, REQUEST_TIME))
            .layer(middleware::from_fn_with_state(api.clone(), guard))
            .layer(SetResponseHeaderLayer::if_not_present(nosniff.0, nosniff.1))
            .layer(SetResponseHeaderLayer::if_not_present(uncached.0, uncached.1))
            .layer(CatchPanicLayer::new())
            .with_state(api);
        Self {
            router,
            daemon,
            places: Arc::new(Semaphore::new(keys.max_clients as usize)),
            stall: Duration::from_secs_f64(keys.stall_s),
        }
    }
}

/// Lets in only what may come in, at the rate that is allowed.
async fn guard(State(api): State<Api>, request: Request, next: Next) -> Response {
    let now = api.epoch.elapsed();
    // Nothing under this lock can panic, so a poisoned one holds what it should.
    let free = api.bucket.lock().unwrap_or_else(PoisonError::into_inner).take(now);
    if !free {
        let help = "ask less often, or subscribe to /v1/live/records";
        let refusal = Failed::new(StatusCode::TOO_MANY_REQUESTS, "too many requests", help);
        return ([(header::RETRY_AFTER, "1")], refusal).into_response();
    }
    // A request that came in by no connection of this server is trusted with nothing.
    let peer = request.extensions().get().copied().unwrap_or(Peer::Network);
    match api.access.check(peer, request.method(), request.uri(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refused) => Failed::from(refused).into_response(),
    }
}

async fn nothing_here() -> Failed {
    Failed::new(StatusCode::NOT_FOUND, "there is nothing here", "see GET /v1/openapi.json")
}

async fn other_method() -> Failed {
    let help = "see GET /v1/openapi.json";
    Failed::new(StatusCode::METHOD_NOT_ALLOWED, "this can't be done here", help)
}
