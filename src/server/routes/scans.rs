//! Scans of the logs: the newest, one with its readings, and one beam of it.

use std::{
    io,
    sync::{Arc, PoisonError},
};

use axum::{Json, extract::State, http::StatusCode};
use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use uuid::Uuid;

use super::{
    beam::{Beam, look},
    scene::FloorPlan,
};
use crate::{
    compare::{NotCompared, Verdict, judge},
    geometry::Pose,
    scan::{Event, Ping, Provenance, ScanEnd, ScanPlan, ScanStart, ScanView, Session},
    scene::Scene,
    server::{
        Api,
        answer::{Failed, Path, Query},
        openapi::Endpoint,
    },
    store::{History, PastScan, logged_scene},
};

/// Scans listed when nothing else is asked for.
const USUAL: u16 = 50;
/// Most scans that are listed.
const MOST: u16 = 500;

/// A scan in a list.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct ListedScan {
    /// The scan.
    scan: Uuid,
    /// When it began.
    time: Timestamp,
    /// Its log, for GET /v1/logs/{name}.
    log: String,
    /// Where the ranger stood.
    pose: Pose,
    /// What was to be measured.
    plan: ScanPlan,
    /// Where its readings come from.
    provenance: Option<Provenance>,
    /// Name of the scene that the model was given.
    scene: Option<String>,
    /// How it ended; `null` for one under way, or broken off.
    end: Option<ScanEnd>,
}

/// A scan with its readings.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct WholeScan {
    /// What was true for it; `null` if the log lacks it.
    session: Option<Arc<Session>>,
    /// How it began.
    start: Option<ScanStart>,
    /// Its readings, in the order of the log.
    pings: Vec<JudgedPing>,
    /// What happened meanwhile.
    events: Vec<Event>,
    /// How it ended; `null` for one under way, or broken off.
    end: Option<ScanEnd>,
}

/// A reading and what explains it.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub(super) struct JudgedPing {
    /// The reading.
    #[serde(flatten)]
    pub(super) ping: Ping,
    /// What explains it.
    pub(super) verdict: Word,
}

/// What explains a reading, or why it can't be compared with a prediction.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum Word {
    /// Compared with the prediction.
    Compared(Verdict),
    /// Not compared, and why.
    NotCompared(NotCompared),
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Limit {
    #[serde(default)]
    limit: Option<u16>,
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
    Query(Limit { limit }): Query<Limit>,
) -> Result<Json<Vec<ListedScan>>, Failed> {
    let limit = limit.unwrap_or(USUAL);
    if !(1..=MOST).contains(&limit) {
        let (status, help) = (StatusCode::UNPROCESSABLE_ENTITY, "from 1 to 500");
        return Err(Failed::new(status, format!("limit is {limit}"), help));
    }
    let scans = in_history(&api, move |history| history.newest(limit.into())).await?;
    Ok(Json(scans.into_iter().map(ListedScan::from).collect()))
}

async fn whole(
    State(api): State<Api>,
    Path(scan): Path<String>,
) -> Result<Json<WholeScan>, Failed> {
    let view = find(&api, &scan).await?;
    Ok(Json(WholeScan {
        session: view.session,
        start: view.start,
        pings: view.pings.into_iter().map(JudgedPing::from).collect(),
        events: view.events,
        end: view.end,
    }))
}

async fn beam(
    State(api): State<Api>,
    Path((scan, index)): Path<(String, String)>,
) -> Result<Json<Beam>, Failed> {
    let view = find(&api, &scan).await?;
    let index = index.parse().ok();
    // Of a beam that was measured twice, the last reading counts.
    let ping = view.pings.iter().rev().find(|ping| Some(ping.index) == index).cloned();
    let ping = ping.ok_or_else(|| {
        let last = view.pings.iter().map(|ping| ping.index).max().unwrap_or_default();
        let help = format!("readings so far run up to {last}");
        Failed::new(StatusCode::NOT_FOUND, "the scan has no such beam", help)
    })?;
    let scene = scene_of(&api, view.scan, view.session.as_deref()).await?;
    // One after the other, also when clients leave meanwhile: asking the model takes its time.
    let turn = Arc::clone(&api.looking).acquire_owned().await;
    let looking = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        look(&view, ping, scene.as_deref())
    });
    looking.await.map(Json).map_err(|error| broken(&error))
}

async fn scene(
    State(api): State<Api>,
    Path(scan): Path<String>,
) -> Result<Json<FloorPlan>, Failed> {
    let missing = |error: String, help: &str| Failed::new(StatusCode::NOT_FOUND, error, help);
    let no_scan = || missing("there is no such scan".into(), "GET /v1/scans names the newest");
    let id = Uuid::parse_str(&scan).map_err(|_| no_scan())?;
    let (view, _) =
        in_history(&api, move |history| history.outline(id)).await?.ok_or_else(no_scan)?;
    let scene = scene_of(&api, id, view.session.as_deref()).await?;
    let taken_in = view.session.as_deref().and_then(|session| session.scene.as_ref());
    match scene.filter(|scene| taken_in.is_some_and(|taken_in| taken_in.sha256 == scene.sha256)) {
        Some(scene) => Ok(Json(FloorPlan::of(&scene))),
        None => Err(missing(
            "the log does not hold the scene of this scan".into(),
            "logs hold their scene since it is written into them; older ones name it only",
        )),
    }
}

/// The scene that a scan was taken in: the one in force, or the one in its log. The one in force
/// also where the log says nothing.
async fn scene_of(
    api: &Api,
    scan: Uuid,
    session: Option<&Session>,
) -> Result<Option<Arc<Scene>>, Failed> {
    let in_force = api.daemon.scene();
    let taken_in = session.and_then(|session| session.scene.as_ref());
    let fits = |scene: &Scene| taken_in.is_none_or(|taken_in| taken_in.sha256 == scene.sha256);
    if in_force.as_deref().is_some_and(fits) {
        return Ok(in_force);
    }
    let logged = in_history(api, move |history| {
        let Some((view, log)) = history.outline(scan)? else { return Ok(None) };
        Ok(view.session.and_then(|session| logged_scene(&session, &log).ok().flatten()))
    });
    Ok(logged.await?.map(Arc::new).or(in_force))
}

async fn find(api: &Api, scan: &str) -> Result<ScanView, Failed> {
    let missing = || {
        let help = "GET /v1/scans names the newest; older ones are in GET /v1/logs";
        Failed::new(StatusCode::NOT_FOUND, "there is no such scan", help)
    };
    let id = Uuid::parse_str(scan).map_err(|_| missing())?;
    in_history(api, move |history| history.scan(id)).await?.ok_or_else(missing)
}

/// Looks into the logs, beside everything else: disks block.
async fn in_history<T: Send + 'static>(
    api: &Api,
    ask: impl FnOnce(&mut History) -> io::Result<T> + Send + 'static,
) -> Result<T, Failed> {
    let history = Arc::clone(&api.history);
    let asking = tokio::task::spawn_blocking(move || {
        ask(&mut history.lock().unwrap_or_else(PoisonError::into_inner))
    });
    let answer = asking.await.map_err(|error| broken(&error))?;
    answer.map_err(|error| {
        let help = "check the log folder and its permissions";
        let error = format!("cannot read the logs: {error}");
        Failed::new(StatusCode::INTERNAL_SERVER_ERROR, error, help)
    })
}

fn broken(error: &tokio::task::JoinError) -> Failed {
    let help = "this is a fault of the program";
    Failed::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string(), help)
}

impl From<PastScan> for ListedScan {
    fn from(past: PastScan) -> Self {
        Self {
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
}

impl From<Ping> for JudgedPing {
    fn from(ping: Ping) -> Self {
        let verdict = Word::of(&ping);
        Self { ping, verdict }
    }
}

impl Word {
    pub(super) fn of(ping: &Ping) -> Self {
        judge(ping).verdict.map_or_else(Self::NotCompared, Self::Compared)
    }
}
