//! The HTTP API, on a unix socket and on loopback TCP.
//!
//! Everything a client can do to the server is bounded: connections, requests a second, size and
//! time of a request, time without reading, and memory in bytes. A client that hits a bound loses its
//! connection, and never one of another's: whoever comes by the unix socket, shows the token, or is
//! neither, has places and requests a second of their own. The operator, who measures, is a task of
//! its own and never waits for a client.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod access;
mod answer;
mod connection;
mod descriptors;
mod foxglove;
mod listen;
mod openapi;
mod plain;
mod rate;
mod routes;
mod slots;
mod token;

use std::{
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
use sonard_api::{config::Keys, fleet::Asked};
use sonard_log::History;
use sonard_model::scene::Scene;
use sonard_records::Session;
use tokio::{
    sync::{Semaphore, watch},
    time::{Instant, timeout},
};
use tower_http::{catch_panic::CatchPanicLayer, set_header::SetResponseHeaderLayer};

pub use access::{Access, Peer, Refused, Standing};
pub use listen::{ListenError, Listeners};
pub use token::{read_token, token_help};

use crate::Handle;
use answer::{Failed, Shelved};
use descriptors::connection_shares;
use foxglove::Viewers;
use rate::Buckets;
use slots::Slots;

/// How long a request may take until its answer begins.
const REQUEST_TIME: Duration = Duration::from_secs(10);

/// Pages of elsewhere may not show or run what is answered here.
const NO_STRANGERS: HeaderName = HeaderName::from_static("cross-origin-resource-policy");

/// What every handler knows.
#[derive(Clone)]
pub(crate) struct Api {
    daemon: Handle,
    log_folder: Arc<PathBuf>,
    /// The OpenAPI document.
    document: Bytes,
    access: Arc<Access>,
    history: Arc<Mutex<History>>,
    /// Where viewers come together, if there are any.
    foxglove: Option<Arc<Viewers>>,
    /// Said once that a viewer's page may not ask: browsers hide why from whom they refuse.
    has_told_origin: Arc<AtomicBool>,
    /// What is known of other robots, if they are asked.
    fleet: Option<watch::Receiver<Bytes>>,
    /// Folder of the playground, if it is served.
    playground: Option<Arc<Path>>,
    /// Who asks the model about a beam.
    looking: Arc<Semaphore>,
    /// Who asks where scans were taken.
    locating: Arc<Semaphore>,
    /// Who reads a scan's next piece.
    reading: Arc<Semaphore>,
    scene: Shelved<Scene>,
    session: Shelved<Session>,
    places: Arc<Slots>,
    buckets: Arc<Mutex<Buckets>>,
    epoch: Instant,
}

/// The server, before it has sockets.
pub struct Server {
    router: Router,
    daemon: Handle,
    foxglove: Option<Arc<Viewers>>,
    places: Arc<Slots>,
    doorstep: Arc<Semaphore>,
    stall: Duration,
}

impl Server {
    /// A server of `daemon`, whose logs are in `log_folder`, and which asks the daemons of `fleet`. Must be called within a tokio runtime, before the daemon
    /// runs.
    #[must_use]
    pub fn new(
        daemon: Handle,
        log_folder: PathBuf,
        access: Access,
        keys: &Keys,
        fleet: Vec<Asked>,
    ) -> Self {
        let endpoints = routes::endpoints();
        let viewers = &keys.foxglove;
        let foxglove = viewers.enabled.then(|| Viewers::open(&daemon, viewers));
        let keys = &keys.server;
        // Each daemon of the fleet is asked on a connection of its own.
        let (shares, rejecting) =
            connection_shares(keys.max_clients as usize, keys.listen.is_some(), fleet.len());
        let places = Arc::new(Slots::new(shares));
        let api = Api {
            daemon: daemon.clone(),
            history: Arc::new(Mutex::new(History::new(log_folder.clone()))),
            foxglove: foxglove.clone(),
            has_told_origin: Arc::default(),
            fleet: (!fleet.is_empty())
                .then(|| sonard_api::fleet::watch(fleet, daemon.supervisor())),
            playground: keys.playground.as_deref().map(|folder| Path::new(folder).into()),
            looking: Arc::new(Semaphore::new(1)),
            locating: Arc::new(Semaphore::new(1)),
            reading: Arc::new(Semaphore::new(1)),
            scene: Shelved::default(),
            session: Shelved::default(),
            log_folder: Arc::new(log_folder),
            document: openapi::document(&endpoints).to_string().into(),
            access: Arc::new(access),
            places: Arc::clone(&places),
            buckets: Arc::new(Mutex::new(Buckets::new(keys.max_requests_per_s))),
            epoch: Instant::now(),
        };
        let on_all = |name, value| {
            SetResponseHeaderLayer::if_not_present(name, HeaderValue::from_static(value))
        };
        let router = openapi::router(endpoints)
            .fallback(nothing_here)
            .method_not_allowed_fallback(other_method)
            .layer(DefaultBodyLimit::max(keys.max_body_kb as usize * 1000))
            .layer(middleware::from_fn(in_time))
            .layer(middleware::from_fn_with_state(api.clone(), guard))
            .layer(CatchPanicLayer::custom(|_| failed_within().into_response()))
            .layer(on_all(header::X_CONTENT_TYPE_OPTIONS, "nosniff"))
            .layer(on_all(header::CACHE_CONTROL, "no-store"))
            .layer(on_all(NO_STRANGERS, "same-origin"))
            .with_state(api);
        Self {
            router,
            daemon,
            foxglove,
            places,
            doorstep: Arc::new(Semaphore::new(rejecting)),
            stall: Duration::from_secs_f64(keys.stall_s),
        }
    }

    /// The API without connections: requests carry a [`Peer`] as an extension.
    #[must_use]
    pub fn router(&self) -> Router {
        self.router.clone()
    }
}

impl Api {
    /// Says why a viewer was refused whose page is from elsewhere, once.
    fn tell_of_refused_viewer(&self, uri: &Uri, refused: &Refused) {
        let is_viewer = self.foxglove.is_some() && uri.path() == routes::FOXGLOVE;
        if is_viewer
            && refused.status == StatusCode::FORBIDDEN
            && !self.has_told_origin.swap(true, Ordering::Relaxed)
        {
            tracing::warn!("foxglove: {}: {}", refused.message, refused.help);
        }
    }
}

/// Lets in only what may come in, at the rate that is allowed. What may not costs nobody who may: it
/// is counted nowhere, and gives its place back.
async fn guard(State(api): State<Api>, mut request: Request, next: Next) -> Response {
    // A request that came in by no connection of this server is trusted with nothing.
    let peer = request.extensions().get().copied().unwrap_or(Peer::Network);
    let standing = match api.access.check(peer, request.method(), request.uri(), request.headers())
    {
        Ok(standing) => standing,
        Err(refused) => {
            api.tell_of_refused_viewer(request.uri(), &refused);
            return ([(header::CONNECTION, "close")], Failed::from(refused)).into_response();
        }
    };
    let now = api.epoch.elapsed();
    // Nothing under this lock can panic, so a poisoned one holds what it should.
    if !api.buckets.lock().unwrap_or_else(PoisonError::into_inner).take(standing, now) {
        let help = "ask less often, or subscribe to /v1/live/records";
        let refusal = Failed::new(StatusCode::TOO_MANY_REQUESTS, "too many requests", help);
        return ([(header::RETRY_AFTER, "1")], refusal).into_response();
    }
    request.extensions_mut().insert(standing);
    next.run(request).await
}

/// Gives up on a request whose answer does not begin.
async fn in_time(request: Request, next: Next) -> Response {
    timeout(REQUEST_TIME, next.run(request)).await.unwrap_or_else(|_| {
        let error = format!("nothing came of it within {} s", REQUEST_TIME.as_secs());
        let help = "send the whole request at once, or try again later";
        Failed::new(StatusCode::REQUEST_TIMEOUT, error, help).into_response()
    })
}

fn failed_within() -> Failed {
    let help = "this is a fault of the program: see its messages";
    Failed::new(StatusCode::INTERNAL_SERVER_ERROR, "the daemon failed at this request", help)
}

async fn nothing_here() -> Failed {
    Failed::new(StatusCode::NOT_FOUND, "there is nothing here", "see GET /v1/openapi.json")
}

async fn other_method() -> Failed {
    let help = "see GET /v1/openapi.json";
    Failed::new(StatusCode::METHOD_NOT_ALLOWED, "this can't be done here", help)
}
