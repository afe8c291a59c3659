//! Scans of the logs: the newest, one with its readings, and one beam of it.

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
use sonard_log::{History, Passage, PastScan, logged_scene};
use sonard_model::scene::Scene;
use tokio::time::{Instant, sleep};
use uuid::Uuid;

use super::{
    beam::look,
    pieces::{Form, Pieces, stream},
};
use crate::{
    Moved,
    server::{
        Api,
        answer::{Failed, Path, Query},
        openapi::Endpoint,
    },
};

/// Scans listed when nothing else is asked for.
const USUAL: u16 = 50;
/// Most scans that are listed.
const MOST: u16 = 500;
/// How long the log may take to have what was measured.
const WRITING: Duration = Duration::from_secs(5);

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Listing {
    #[serde(default)]
    limit: Option<u16>,
    #[serde(default)]
    before: Option<Uuid>,
}

pub(super) fn endpoints() -> Vec<Endpoint> {
    let uuid = || json!({"type": "string", "format": "uuid"});
    vec![
        Endpoint::get("/v1/scans", list, "The newest scans of the logs, newest first")
            .parameter(
                "query",
                "limit",
                json!({"type": "integer", "minimum": 1, "maximum": MOST}),
                "At most so many; without it, 50. Only the eight newest logs are looked at",
            )
            .parameter("query", "before", uuid(), "Only scans that were taken before this one")
            .answers::<Vec<ListedScan>>(200, "The scans"),
        Endpoint::get("/v1/scans/{scan}", whole, "A scan of the logs with its readings")
            .parameter("path", "scan", uuid(), "A scan from GET /v1/scans, or the one under way")
            .answers::<WholeScan>(200, "The scan"),
        Endpoint::get(
            "/v1/scans/{scan}/beams/{index}",
            beam,
            "A beam: its echoes, what the model hears, and the ways of the sound",
        )
        .parameter("path", "scan", uuid(), "A scan from GET /v1/scans, or the one under way")
        .parameter(
            "path",
            "index",
            json!({"type": "integer", "minimum": 0}),
            "Index of the reading in the scan's plan",
        )
        .answers::<Beam>(200, "The beam"),
        Endpoint::get(
            "/v1/scans/{scan}/scene",
            scene,
            "The floor plan of the scene that a scan was predicted in, from its log",
        )
        .parameter("path", "scan", uuid(), "A scan from GET /v1/scans, or the one under way")
        .answers::<FloorPlan>(200, "The floor plan"),
    ]
}

async fn list(
    State(api): State<Api>,
    Query(Listing { limit, before }): Query<Listing>,
) -> Result<Json<Vec<ListedScan>>, Failed> {
    let limit = limit.unwrap_or(USUAL);
    if !(1..=MOST).contains(&limit) {
        let (status, help) = (StatusCode::UNPROCESSABLE_ENTITY, "from 1 to 500");
        return Err(Failed::new(status, format!("limit is {limit}"), help));
    }
    let most = limit.into();
    let scans = in_history(&api, move |history| match before {
        None => history.newest(most).map(Some),
        Some(scan) => history.before(scan, most),
    });
    let scans = scans.await?.ok_or_else(no_such_scan)?;
    Ok(Json(scans.into_iter().map(listed).collect()))
}

async fn whole(State(api): State<Api>, Path(scan): Path<String>) -> Result<Response, Failed> {
    let passage = find(&api, &scan).await?;
    Ok(answer(&api, Pieces::new(passage, Form::Whole, Moved::default())))
}

/// A scan as JSON, piece by piece.
pub(super) fn answer(api: &Api, pieces: Pieces) -> Response {
    let media = [(header::CONTENT_TYPE, "application/json")];
    let body = axum::body::Body::from_stream(stream(pieces, Arc::clone(&api.reading)));
    (media, body).into_response()
}

async fn beam(
    State(api): State<Api>,
    Path((scan, index)): Path<(String, String)>,
) -> Result<Json<Beam>, Failed> {
    let passage = find(&api, &scan).await?;
    let scene = scene_of(&api, &passage).await?;
    // One after the other, also when clients leave meanwhile: asking the model takes its time.
    let turn = Arc::clone(&api.looking).acquire_owned().await;
    let looking = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        // Of a beam that was measured twice, the last reading counts.
        let index = index.parse().ok();
        let (ping, highest) =
            passage.beam(index.unwrap_or(u32::MAX)).map_err(|e| unreadable(&e))?;
        let ping = ping.filter(|_| index.is_some()).ok_or_else(|| {
            let help = format!("readings so far run up to {}", highest.unwrap_or_default());
            Failed::new(StatusCode::NOT_FOUND, "the scan has no such beam", help)
        })?;
        Ok(Json(look(&passage.view, ping, scene.as_deref())))
    });
    looking.await.map_err(|error| broken(&error))?
}

async fn scene(
    State(api): State<Api>,
    Path(scan): Path<String>,
) -> Result<Json<FloorPlan>, Failed> {
    let passage = find(&api, &scan).await?;
    let scene = scene_of(&api, &passage).await?;
    let taken_in = passage.view.session.as_deref().and_then(|session| session.scene.as_ref());
    match scene.filter(|scene| taken_in.is_some_and(|taken_in| taken_in.sha256 == scene.sha256)) {
        Some(scene) => Ok(Json(FloorPlan::of(&scene))),
        None => Err(Failed::new(
            StatusCode::NOT_FOUND,
            "the log does not hold the scene of this scan",
            "logs hold their scene since it is written into them; older ones name it only",
        )),
    }
}

/// The scene that a scan was taken in: the one in force, or the one in its log. The one in force
/// also where the log says nothing.
async fn scene_of(api: &Api, passage: &Passage) -> Result<Option<Arc<Scene>>, Failed> {
    let (in_force, passage) = (api.daemon.scene(), passage.clone());
    let finding = tokio::task::spawn_blocking(move || taken_in(in_force, &passage));
    finding.await.map_err(|error| broken(&error))
}

/// The same; it may read the disk.
pub(super) fn taken_in(in_force: Option<Arc<Scene>>, passage: &Passage) -> Option<Arc<Scene>> {
    let session = passage.view.session.as_deref();
    let taken_in = session.and_then(|session| session.scene.as_ref());
    let fits = |scene: &Scene| taken_in.is_none_or(|taken_in| taken_in.sha256 == scene.sha256);
    if in_force.as_deref().is_some_and(fits) {
        return in_force;
    }
    let logged = session.and_then(|session| logged_scene(session, &passage.path).ok().flatten());
    logged.map(Arc::new).or(in_force)
}

pub(super) async fn find(api: &Api, scan: &str) -> Result<Passage, Failed> {
    let id = Uuid::parse_str(scan).map_err(|_| no_such_scan())?;
    in_history(api, move |history| history.passage(id)).await?.ok_or_else(no_such_scan)
}

/// The same, with all of it if it has just ended: that may not be in the log yet.
pub(super) async fn find_written(api: &Api, scan: &str) -> Result<Passage, Failed> {
    let passage = find(api, scan).await?;
    if passage.view.end.is_none() && api.daemon.latest_scan() == Some(passage.view.scan) {
        return Ok(written(api, passage.view.scan).await?.unwrap_or(passage));
    }
    Ok(passage)
}

pub(super) fn no_such_scan() -> Failed {
    let help = "GET /v1/scans names the newest; older ones are in GET /v1/logs";
    Failed::new(StatusCode::NOT_FOUND, "there is no such scan", help)
}

/// A scan that has just ended, as soon as all of it is in the log; `None` if that does not come to be.
pub(super) async fn written(api: &Api, scan: Uuid) -> Result<Option<Passage>, Failed> {
    let mut wait = Duration::from_millis(5);
    let until = Instant::now() + WRITING;
    loop {
        let passage = in_history(api, move |history| history.passage(scan)).await?;
        if let Some(passage) = passage.filter(|passage| passage.view.end.is_some()) {
            return Ok(Some(passage));
        }
        if Instant::now() >= until {
            return Ok(None);
        }
        sleep(wait).await;
        wait = (wait * 2).min(Duration::from_millis(200));
    }
}

/// Looks into the logs, beside everything else: disks block.
pub(super) async fn in_history<T: Send + 'static>(
    api: &Api,
    ask: impl FnOnce(&mut History) -> io::Result<T> + Send + 'static,
) -> Result<T, Failed> {
    let history = Arc::clone(&api.history);
    let asking = tokio::task::spawn_blocking(move || {
        ask(&mut history.lock().unwrap_or_else(PoisonError::into_inner))
    });
    let answer = asking.await.map_err(|error| broken(&error))?;
    answer.map_err(|error| unreadable(&error))
}

pub(super) fn unreadable(error: &io::Error) -> Failed {
    let help = "check the log folder and its permissions";
    let error = format!("cannot read the logs: {error}");
    Failed::new(StatusCode::INTERNAL_SERVER_ERROR, error, help)
}

pub(super) fn broken(error: &tokio::task::JoinError) -> Failed {
    let help = "this is a fault of the program";
    Failed::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string(), help)
}

/// A scan of the history as a list has it.
fn listed(past: PastScan) -> ListedScan {
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
