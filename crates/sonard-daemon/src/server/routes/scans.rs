//! Scans of the logs: list of the newest, one with its readings, and one beam.

use std::{
    io,
    sync::{Arc, PoisonError},
    time::Duration,
};

use axum::{
    Json,
    extract::State,
    http::{StatusCode, header},
    response::{IntoResponse as _, Response},
};
use serde::Deserialize;
use serde_json::json;
use sonard_api::{Beam, FloorPlan, ListedScan, WholeScan};
use sonard_log::{LogIndex, LoggedScan, ScanSpan, logged_scene};
use sonard_model::scene::Scene;
use tokio::time::{Instant, sleep};
use uuid::Uuid;

use super::{
    beam::describe_beam,
    pieces::{ScanForm, ScanPieces, stream},
};
use crate::{
    DeadbandFilter,
    server::{
        Api,
        openapi::Route,
        response::{ApiError, PathParams, QueryParams},
    },
};

/// Default number of listed scans.
const DEFAULT_LIMIT: u16 = 50;
/// Maximum number of listed scans.
const MAX_LIMIT: u16 = 500;
/// Maximum wait until a completed scan is in the log.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Listing {
    #[serde(default)]
    limit: Option<u16>,
    #[serde(default)]
    before: Option<Uuid>,
}

pub(super) fn endpoints() -> Vec<Route> {
    let uuid = || json!({"type": "string", "format": "uuid"});
    vec![
        Route::get("/v1/scans", list, "Newest scans of the logs, newest first")
            .parameter(
                "query",
                "limit",
                json!({"type": "integer", "minimum": 1, "maximum": MAX_LIMIT}),
                "Maximum number of scans; default 50. Only the eight newest logs are searched",
            )
            .parameter("query", "before", uuid(), "Only scans before this one")
            .responds::<Vec<ListedScan>>(200, "List of scans"),
        Route::get("/v1/scans/{scan}", whole, "Scan of the logs with its readings")
            .parameter("path", "scan", uuid(), "Scan from GET /v1/scans, or the current scan")
            .responds::<WholeScan>(200, "Scan"),
        Route::get(
            "/v1/scans/{scan}/beams/{index}",
            beam,
            "Beam of a scan: measured echoes, predicted arrivals and propagation paths",
        )
        .parameter("path", "scan", uuid(), "Scan from GET /v1/scans, or the current scan")
        .parameter(
            "path",
            "index",
            json!({"type": "integer", "minimum": 0}),
            "Index of the reading in the scan's plan",
        )
        .responds::<Beam>(200, "Beam"),
        Route::get(
            "/v1/scans/{scan}/scene",
            scene,
            "Floor plan of the scene used to predict a scan, from its log",
        )
        .parameter("path", "scan", uuid(), "Scan from GET /v1/scans, or the current scan")
        .responds::<FloorPlan>(200, "Floor plan"),
    ]
}

async fn list(
    State(api): State<Api>,
    QueryParams(Listing { limit, before }): QueryParams<Listing>,
) -> Result<Json<Vec<ListedScan>>, ApiError> {
    let limit = limit.unwrap_or(DEFAULT_LIMIT);
    if !(1..=MAX_LIMIT).contains(&limit) {
        let (status, help) = (StatusCode::UNPROCESSABLE_ENTITY, "from 1 to 500");
        return Err(ApiError::new(status, format!("limit is {limit}"), help));
    }
    let max_scans = limit.into();
    let scans = in_history(&api, move |history| match before {
        None => history.newest(max_scans).map(Some),
        Some(scan) => history.before(scan, max_scans),
    });
    let scans = scans.await?.ok_or_else(scan_not_found)?;
    Ok(Json(scans.into_iter().map(list_entry).collect()))
}

async fn whole(
    State(api): State<Api>,
    PathParams(scan): PathParams<String>,
) -> Result<Response, ApiError> {
    let passage = find(&api, &scan).await?;
    Ok(scan_response(&api, ScanPieces::new(passage, ScanForm::Whole, DeadbandFilter::default())))
}

/// Streams a scan as JSON.
pub(super) fn scan_response(api: &Api, pieces: ScanPieces) -> Response {
    let media = [(header::CONTENT_TYPE, "application/json")];
    let body = axum::body::Body::from_stream(stream(pieces, Arc::clone(&api.reading)));
    (media, body).into_response()
}

async fn beam(
    State(api): State<Api>,
    PathParams((scan, index)): PathParams<(String, String)>,
) -> Result<Json<Beam>, ApiError> {
    let passage = find(&api, &scan).await?;
    let scene = scene_of(&api, &passage).await?;
    // One prediction at a time, even if clients disconnect meanwhile, because predictions take
    // long.
    let permit = Arc::clone(&api.predicting).acquire_owned().await;
    let predicting = tokio::task::spawn_blocking(move || {
        let _permit = permit;
        // The last reading of a repeated beam counts.
        let index = index.parse().ok();
        let (ping, highest) =
            passage.beam(index.unwrap_or(u32::MAX)).map_err(|e| unreadable(&e))?;
        let ping = ping.filter(|_| index.is_some()).ok_or_else(|| {
            let help = format!("the highest index so far is {}", highest.unwrap_or_default());
            ApiError::new(StatusCode::NOT_FOUND, "the scan has no beam of this index", help)
        })?;
        Ok(Json(describe_beam(&passage.view, ping, scene.as_deref())))
    });
    predicting.await.map_err(|error| internal_error(&error))?
}

async fn scene(
    State(api): State<Api>,
    PathParams(scan): PathParams<String>,
) -> Result<Json<FloorPlan>, ApiError> {
    let passage = find(&api, &scan).await?;
    let scene = scene_of(&api, &passage).await?;
    let taken_in = passage.view.session.as_deref().and_then(|session| session.scene.as_ref());
    match scene.filter(|scene| taken_in.is_some_and(|taken_in| taken_in.sha256 == scene.sha256)) {
        Some(scene) => Ok(Json(FloorPlan::from_scene(&scene))),
        None => Err(ApiError::new(
            StatusCode::NOT_FOUND,
            "the log does not contain the scene of this scan",
            "older logs contain only the name of their scene",
        )),
    }
}

/// Returns the scene of a scan: the current one if it matches, or else the one in its log. The
/// current one is also returned if the log has none.
async fn scene_of(api: &Api, passage: &ScanSpan) -> Result<Option<Arc<Scene>>, ApiError> {
    let (current, passage) = (api.daemon.scene(), passage.clone());
    let finding = tokio::task::spawn_blocking(move || load_scene(current, &passage));
    finding.await.map_err(|error| internal_error(&error))
}

/// Blocking part of [`scene_of`]. May read the disk.
pub(super) fn load_scene(current: Option<Arc<Scene>>, passage: &ScanSpan) -> Option<Arc<Scene>> {
    let session = passage.view.session.as_deref();
    let taken_in = session.and_then(|session| session.scene.as_ref());
    let fits = |scene: &Scene| taken_in.is_none_or(|taken_in| taken_in.sha256 == scene.sha256);
    if current.as_deref().is_some_and(fits) {
        return current;
    }
    let logged = session.and_then(|session| logged_scene(session, &passage.path).ok().flatten());
    logged.map(Arc::new).or(current)
}

pub(super) async fn find(api: &Api, scan: &str) -> Result<ScanSpan, ApiError> {
    let id = Uuid::parse_str(scan).map_err(|_| scan_not_found())?;
    in_history(api, move |history| history.scan_span(id)).await?.ok_or_else(scan_not_found)
}

/// Finds a scan. If it has just ended, waits until all of it is in the log.
pub(super) async fn find_written(api: &Api, scan: &str) -> Result<ScanSpan, ApiError> {
    let passage = find(api, scan).await?;
    if passage.view.end.is_none() && api.daemon.latest_scan() == Some(passage.view.scan) {
        return Ok(wait_written(api, passage.view.scan).await?.unwrap_or(passage));
    }
    Ok(passage)
}

pub(super) fn scan_not_found() -> ApiError {
    let help = "GET /v1/scans lists the newest scans; older ones are in GET /v1/logs";
    ApiError::new(StatusCode::NOT_FOUND, "unknown scan", help)
}

/// Waits until all of a completed scan is in the log; `None` on timeout.
pub(super) async fn wait_written(api: &Api, scan: Uuid) -> Result<Option<ScanSpan>, ApiError> {
    let until = Instant::now() + WRITE_TIMEOUT;
    if let Some(passage) = find_complete(api, scan).await? {
        return Ok(Some(passage));
    }
    api.daemon.flush_log(WRITE_TIMEOUT).await;
    let mut wait = Duration::from_millis(5);
    loop {
        let passage = find_complete(api, scan).await?;
        if passage.is_some() || Instant::now() >= until {
            return Ok(passage);
        }
        sleep(wait).await;
        wait = (wait * 2).min(Duration::from_millis(200));
    }
}

/// Finds a scan whose end is in the log.
async fn find_complete(api: &Api, scan: Uuid) -> Result<Option<ScanSpan>, ApiError> {
    let passage = in_history(api, move |history| history.scan_span(scan)).await?;
    Ok(passage.filter(|passage| passage.view.end.is_some()))
}

/// Queries the logs on a blocking thread.
pub(super) async fn in_history<T: Send + 'static>(
    api: &Api,
    query: impl FnOnce(&mut LogIndex) -> io::Result<T> + Send + 'static,
) -> Result<T, ApiError> {
    let history = Arc::clone(&api.history);
    let querying = tokio::task::spawn_blocking(move || {
        query(&mut history.lock().unwrap_or_else(PoisonError::into_inner))
    });
    let result = querying.await.map_err(|error| internal_error(&error))?;
    result.map_err(|error| unreadable(&error))
}

pub(super) fn unreadable(error: &io::Error) -> ApiError {
    let help = "check the log folder and its permissions";
    let error = format!("cannot read the logs: {error}");
    ApiError::new(StatusCode::INTERNAL_SERVER_ERROR, error, help)
}

pub(super) fn internal_error(error: &tokio::task::JoinError) -> ApiError {
    let help = "this is a bug: see the log messages of the daemon";
    ApiError::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string(), help)
}

/// Converts a scan of the history to a list entry.
fn list_entry(past: LoggedScan) -> ListedScan {
    ListedScan {
        scan: past.start.scan,
        time: past.start.time,
        log: past.log,
        pose: past.start.pose,
        plan: past.start.plan,
        provenance: past.provenance,
        scene: past.scene.map(|scene| scene.name),
        end: past.end,
    }
}
