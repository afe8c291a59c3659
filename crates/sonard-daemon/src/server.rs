//! HTTP API on a unix socket and on TCP.
//!
//! Every resource that a client can use is bounded: connections, request rate, size and time of a
//! request, time without reading, and memory in bytes. A client that exceeds a limit loses its own
//! connection only: clients of the unix socket, clients with the token, and all others have
//! separate limits on connections and request rate. The device runs in a task of its own and never
//! waits for a client.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod access;

mod connection;
mod descriptors;
mod error_body;
mod foxglove;
mod limits;
mod listen;
mod openapi;
mod rate;
mod response;
mod routes;
mod token;

use std::{
    panic::AssertUnwindSafe,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use axum::{
    Router,
    body::Bytes,
    extract::{DefaultBodyLimit, Request, State},
    http::{HeaderName, HeaderValue, StatusCode, Uri, header},
    middleware::{self, Next},
    response::{IntoResponse, Response},
};
use futures_util::FutureExt as _;
use sonard_api::{config::Keys, fleet::PolledDaemon};
use sonard_log::LogIndex;
use sonard_model::scene::Scene;
use sonard_records::Session;
use tokio::{
    sync::{Semaphore, watch},
    time::{Instant, timeout},
};

pub use access::{Access, AccessDenied, Peer, Principal};
pub use listen::{ListenError, Listeners};
pub use token::{read_token, token_help};

use crate::Handle;
use descriptors::connection_shares;
use foxglove::Viewers;
use limits::Slots;
use rate::Buckets;
use response::{ApiError, CachedJson};

/// Time limit until the response begins.
const REQUEST_TIME: Duration = Duration::from_secs(10);

/// Headers of responses that do not set them: browsers neither guess types, nor keep responses, nor
/// embed them in pages of other sites.
const DEFAULT_HEADERS: [(HeaderName, HeaderValue); 3] = [
    (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        HeaderValue::from_static("same-origin"),
    ),
];

/// Shared state of all request handlers.
#[derive(Clone)]
pub(crate) struct Api {
    daemon: Handle,
    log_folder: Arc<PathBuf>,
    document: Bytes,
    access: Arc<Access>,
    history: Arc<Mutex<LogIndex>>,
    /// Foxglove viewers, if enabled.
    foxglove: Option<Arc<Viewers>>,
    /// Set once a rejected viewer origin has been logged: browsers hide the reason from the page.
    has_logged_origin: Arc<AtomicBool>,
    /// State of the fleet as JSON, if other robots are polled.
    fleet: Option<watch::Receiver<Bytes>>,
    /// Folder of the playground, if configured.
    playground: Option<Arc<Path>>,
    /// Limits concurrent predictions of beams and previews.
    predicting: Arc<Semaphore>,
    /// Limits concurrent localizations and surveys.
    computing: Arc<Semaphore>,
    surveying: routes::RunningSurvey,
    /// Limits concurrent reads of scan pieces.
    reading: Arc<Semaphore>,
    scene: CachedJson<Scene>,
    session: CachedJson<Session>,
    slots: Arc<Slots>,
    buckets: Arc<Mutex<Buckets>>,
    epoch: Instant,
}

/// HTTP server before it has sockets.
pub struct Server {
    router: Router,
    daemon: Handle,
    foxglove: Option<Arc<Viewers>>,
    slots: Arc<Slots>,
    rejecting_slots: Arc<Semaphore>,
    stall: Duration,
}

impl Server {
    /// Creates the server of `daemon`, with logs in `log_folder`, and polls the daemons of `fleet`.
    /// Must be called within a tokio runtime, before the daemon runs.
    #[must_use]
    pub fn new(
        daemon: Handle,
        log_folder: PathBuf,
        access: Access,
        keys: &Keys,
        fleet: Vec<PolledDaemon>,
    ) -> Self {
        let endpoints = routes::endpoints();
        let viewers = &keys.foxglove;
        let foxglove = viewers.enabled.then(|| Viewers::open(&daemon, viewers));
        let keys = &keys.server;
        // Each daemon of the fleet is polled on a connection of its own.
        let (shares, rejecting) =
            connection_shares(keys.max_clients as usize, keys.listen.is_some(), fleet.len());
        let slots = Arc::new(Slots::new(shares));
        let api = Api {
            daemon: daemon.clone(),
            history: Arc::new(Mutex::new(LogIndex::new(log_folder.clone()))),
            foxglove: foxglove.clone(),
            has_logged_origin: Arc::default(),
            fleet: (!fleet.is_empty())
                .then(|| sonard_api::fleet::watch_fleet(fleet, daemon.supervisor())),
            playground: keys.playground.as_deref().map(|folder| Path::new(folder).into()),
            predicting: Arc::new(Semaphore::new(1)),
            computing: Arc::new(Semaphore::new(1)),
            surveying: routes::RunningSurvey::default(),
            reading: Arc::new(Semaphore::new(1)),
            scene: CachedJson::default(),
            session: CachedJson::default(),
            log_folder: Arc::new(log_folder),
            document: openapi::document(&endpoints).to_string().into(),
            access: Arc::new(access),
            slots: Arc::clone(&slots),
            buckets: Arc::new(Mutex::new(Buckets::new(keys.max_requests_per_s))),
            epoch: Instant::now(),
        };
        let router = openapi::router(endpoints)
            .fallback(not_found)
            .method_not_allowed_fallback(method_not_allowed)
            .layer(DefaultBodyLimit::max(keys.max_body_kb as usize * 1000))
            .layer(middleware::from_fn(limit_time))
            .layer(middleware::from_fn_with_state(api.clone(), check_request))
            .layer(middleware::from_fn(catch_panic))
            .layer(middleware::map_response(add_default_headers))
            .with_state(api);
        Self {
            router,
            daemon,
            foxglove,
            slots,
            rejecting_slots: Arc::new(Semaphore::new(rejecting)),
            stall: Duration::from_secs_f64(keys.write_timeout_s),
        }
    }

    /// Returns the API without connections: requests carry a [`Peer`] as an extension.
    pub fn router(&self) -> Router {
        self.router.clone()
    }
}

impl Api {
    /// Logs once why a viewer of a foreign origin was rejected.
    fn log_rejected_viewer(&self, uri: &Uri, denied: &AccessDenied) {
        let is_viewer = self.foxglove.is_some() && uri.path() == routes::FOXGLOVE;
        if is_viewer
            && denied.status == StatusCode::FORBIDDEN
            && !self.has_logged_origin.swap(true, Ordering::Relaxed)
        {
            tracing::warn!("foxglove: {}: {}", denied.message, denied.help);
        }
    }
}

/// Checks access and request rate. Rejected requests do not count towards any rate, and close their
/// connection.
async fn check_request(State(api): State<Api>, mut request: Request, next: Next) -> Response {
    // Requests without a connection of this server have the least rights.
    let peer = request.extensions().get().copied().unwrap_or(Peer::Network);
    let principal = match api.access.check(peer, request.method(), request.uri(), request.headers())
    {
        Ok(principal) => principal,
        Err(denied) => {
            api.log_rejected_viewer(request.uri(), &denied);
            return ([(header::CONNECTION, "close")], ApiError::from(denied)).into_response();
        }
    };
    let now = api.epoch.elapsed();
    // Nothing under this lock can panic, so a poisoned lock holds valid data.
    if !api.buckets.lock().unwrap_or_else(PoisonError::into_inner).take(principal, now) {
        let help = "send fewer requests, or subscribe to /v1/live/records";
        let error = ApiError::new(StatusCode::TOO_MANY_REQUESTS, "too many requests", help);
        return ([(header::RETRY_AFTER, "1")], error).into_response();
    }
    request.extensions_mut().insert(principal);
    next.run(request).await
}

/// Aborts a request whose response does not begin in time.
async fn limit_time(request: Request, next: Next) -> Response {
    timeout(REQUEST_TIME, next.run(request)).await.unwrap_or_else(|_| {
        let error = format!("no response within {} s", REQUEST_TIME.as_secs());
        let help = "send the whole request at once, or try again later";
        ApiError::new(StatusCode::REQUEST_TIMEOUT, error, help).into_response()
    })
}

/// Makes a panic of a handler an error response; the panic hook has logged it.
async fn catch_panic(request: Request, next: Next) -> Response {
    let response = AssertUnwindSafe(next.run(request)).catch_unwind().await;
    response.unwrap_or_else(|_| internal_error().into_response())
}

fn internal_error() -> ApiError {
    let help = "this is a bug: see the log messages of the daemon";
    ApiError::new(StatusCode::INTERNAL_SERVER_ERROR, "internal error", help)
}

async fn add_default_headers(mut response: Response) -> Response {
    for (name, value) in DEFAULT_HEADERS {
        response.headers_mut().entry(name).or_insert(value);
    }
    response
}

async fn not_found() -> ApiError {
    ApiError::new(StatusCode::NOT_FOUND, "not found", "see GET /v1/openapi.json")
}

async fn method_not_allowed() -> ApiError {
    let help = "see GET /v1/openapi.json";
    ApiError::new(StatusCode::METHOD_NOT_ALLOWED, "method not allowed", help)
}

#[cfg(test)]
mod tests {
    use axum::{body::Body, routing::get};
    use tower::ServiceExt as _;

    use super::*;

    #[tokio::test]
    async fn responses_get_default_headers_even_after_a_panic() {
        async fn panic() {
            panic!("of a test");
        }
        async fn cached() -> impl IntoResponse {
            [(header::CACHE_CONTROL, "max-age=1")]
        }
        let router = Router::new()
            .route("/panic", get(panic))
            .route("/cached", get(cached))
            .layer(middleware::from_fn(catch_panic))
            .layer(middleware::map_response(add_default_headers));
        for (path, status, cache_control) in [
            ("/panic", StatusCode::INTERNAL_SERVER_ERROR, "no-store"),
            ("/cached", StatusCode::OK, "max-age=1"),
        ] {
            let request = Request::get(path).body(Body::empty()).expect("a request");
            let response = router.clone().oneshot(request).await.expect("infallible");
            assert_eq!(response.status(), status, "{path}");
            assert_eq!(response.headers()[header::CACHE_CONTROL], cache_control, "{path}");
            assert_eq!(response.headers()[header::X_CONTENT_TYPE_OPTIONS], "nosniff", "{path}");
        }
    }
}
