//! Localization of scans, of a single one or along a course.

use std::{
    io,
    sync::{Arc, PoisonError},
};

use axum::{extract::State, http::StatusCode, response::Response};
use serde::Deserialize;
use serde_json::json;
use sonard_api::Location;
use sonard_inverse::{
    CoarseGrid, FitObserver, FitSweep, Odometry, Tracker, World, diagnose, locate_observed,
};
use sonard_log::{LogIndex, ScanSpan};
use sonard_records::Session;
use uuid::Uuid;

use super::{
    findings::read,
    results::{acquire_permit, stream_results},
    scans::{find_written, in_history, internal_error, load_scene, scan_not_found},
};
use crate::server::{
    Api,
    openapi::Route,
    response::{ApiError, PathParams, QueryParams},
};

/// Maximum number of scans of a course.
const MAX_SCANS: usize = 500;

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct CourseQuery {
    #[serde(default)]
    to: Option<Uuid>,
    #[serde(default)]
    drift_m_per_m: Option<f64>,
    #[serde(default)]
    drift_deg_per_m: Option<f64>,
    #[serde(default, alias = "carried")]
    kidnap_probability: Option<f64>,
}

pub(super) fn endpoints() -> Vec<Route> {
    let uuid = || json!({"type": "string", "format": "uuid"});
    let up_to = |max: f64| json!({"type": "number", "minimum": 0, "maximum": max});
    vec![
        Route::get(
            "/v1/scans/{scan}/location",
            location,
            "Pose of a scan estimated from its readings, as by `sonard locate`. At most 4000 readings; one client at a \
             time",
        )
        .parameter("path", "scan", uuid(), "Scan from GET /v1/scans, or the current scan")
        .responds::<Location>(200, "All poses that fit the readings, most probable first"),
        Route::get(
            "/v1/scans/{scan}/course",
            course,
            "Poses of a scan and its successors, with the logged poses as odometry, as by `sonard locate --course`. At \
             most 500 scans; one client at a time",
        )
        .parameter("path", "scan", uuid(), "First scan of the course, from GET /v1/scans")
        .parameter("query", "to", uuid(), "Last scan of the course; by default the newest")
        .parameter(
            "query",
            "drift_m_per_m",
            up_to(1.0),
            "Standard deviation of the odometry position per metre driven, metres; default 0.05",
        )
        .parameter(
            "query",
            "drift_deg_per_m",
            up_to(180.0),
            "Standard deviation of the odometry heading per metre driven, degrees; default 5",
        )
        .parameter(
            "query",
            "kidnap_probability",
            up_to(1.0),
            "Probability that the robot was displaced between two scans; default 0.02",
        )
        .responds_as::<Location>(
            200,
            "application/x-ndjson",
            "One scan per line, as soon as it is located",
        ),
    ]
}

async fn location(
    State(api): State<Api>,
    PathParams(scan): PathParams<String>,
) -> Result<Response, ApiError> {
    let passage = find_written(&api, &scan).await?;
    let permit = acquire_permit(&api).await?;
    let reader_api = api.clone();
    let reading =
        tokio::task::spawn_blocking(move || LocatableScan::load(&reader_api, &passage, None));
    let place = reading
        .await
        .map_err(|error| internal_error(&error))?
        .map_err(|why| ApiError::new(StatusCode::CONFLICT, why, "see `sonard locate --help`"))?;
    Ok(stream_results("application/json", permit, move |sender| {
        let mut locator = ScanLocator::new(None);
        let _ = sender.send(&locator.locate(place, sender), "");
    }))
}

async fn course(
    State(api): State<Api>,
    PathParams(scan): PathParams<String>,
    QueryParams(query): QueryParams<CourseQuery>,
) -> Result<Response, ApiError> {
    let odometry = odometry(query)?;
    let from = Uuid::parse_str(&scan).map_err(|_| scan_not_found())?;
    let find = move |history: &mut LogIndex| scans_between(history, from, query.to);
    let scans = in_history(&api, find).await?.ok_or_else(|| {
        let error = format!("scan {from} is not among the {MAX_SCANS} scans up to the last one");
        ApiError::new(StatusCode::NOT_FOUND, error, "GET /v1/scans lists the scans, newest first")
    })?;
    let permit = acquire_permit(&api).await?;
    Ok(stream_results("application/x-ndjson", permit, move |sender| {
        let mut locator = ScanLocator::new(Some(Tracker::new(odometry)));
        // Localization stops if the client has disconnected.
        let _ = scans.into_iter().try_for_each(|scan| {
            let location = match load_scan(&api, scan, &locator) {
                Ok(place) => locator.locate(place, sender),
                Err(why) => unlocated(scan, why),
            };
            sender.send(&location, "\n")
        });
    }))
}

fn odometry(query: CourseQuery) -> Result<Odometry, ApiError> {
    let defaults = Odometry::default();
    let within = |name: &str, given: Option<f64>, default: f64, max: f64| {
        let value = given.unwrap_or(default);
        (0.0..=max).contains(&value).then_some(value).ok_or_else(|| {
            let help = format!("from 0 to {max}");
            ApiError::new(StatusCode::UNPROCESSABLE_ENTITY, format!("{name} is {value}"), help)
        })
    };
    Ok(Odometry {
        drift_m_per_m: within("drift_m_per_m", query.drift_m_per_m, defaults.drift_m_per_m, 1.0)?,
        drift_deg_per_m: within(
            "drift_deg_per_m",
            query.drift_deg_per_m,
            defaults.drift_deg_per_m,
            180.0,
        )?,
        kidnap_probability: within(
            "kidnap_probability",
            query.kidnap_probability,
            defaults.kidnap_probability,
            1.0,
        )?,
    })
}

/// Returns the scans from `from` to `to` or to the newest, oldest first; `None` if `from` is not
/// among the last ones before `to`.
fn scans_between(
    history: &mut LogIndex,
    from: Uuid,
    to: Option<Uuid>,
) -> io::Result<Option<Vec<Uuid>>> {
    let mut scans: Vec<Uuid> = to.into_iter().collect();
    let max_before = MAX_SCANS - scans.len();
    let before = match to {
        None => history.newest(max_before)?,
        Some(to) => match history.before(to, max_before)? {
            None => return Ok(None),
            Some(before) => before,
        },
    };
    scans.extend(before.iter().map(|past| past.start.scan));
    let first = scans.iter().position(|scan| *scan == from);
    Ok(first.map(|first| {
        scans.truncate(first + 1);
        scans.reverse();
        scans
    }))
}

/// Scan with the scene and model needed to locate it.
struct LocatableScan {
    sweep: FitSweep,
    session: Arc<Session>,
    world: Arc<World>,
}

/// Loads a scan of the logs.
fn load_scan(api: &Api, scan: Uuid, locator: &ScanLocator) -> Result<LocatableScan, String> {
    let found = api.history.lock().unwrap_or_else(PoisonError::into_inner).scan_span(scan);
    let passage = found.map_err(|error| format!("cannot read the logs: {error}"))?;
    let passage = passage.ok_or("the newest logs do not contain this scan")?;
    LocatableScan::load(api, &passage, locator.previous.as_ref())
}

impl LocatableScan {
    /// Prepares a scan for localization, or returns the reason why it can't be located. The world
    /// of the previous scan is reused if the session is equal. Reads the disk.
    fn load(
        api: &Api,
        passage: &ScanSpan,
        previous: Option<&PreviousScan>,
    ) -> Result<Self, String> {
        let view = read(passage).map_err(|failed| failed.problem.error)?;
        let sweep = FitSweep::from_scan(&view).map_err(|error| error.to_string())?;
        let session = view.session.ok_or("the log does not contain the scan's session")?;
        if let Some(previous) = previous.filter(|previous| *previous.session == *session) {
            let (session, world) = (Arc::clone(&previous.session), Arc::clone(&previous.world));
            return Ok(Self { sweep, session, world });
        }
        let scene = load_scene(api.daemon.scene(), passage);
        let own_scene = session.scene.as_ref();
        let scene =
            scene.filter(|scene| own_scene.is_none_or(|own| own.sha256 == scene.sha256)).ok_or(
                "the log does not contain the scan's scene, and the current scene is another one",
            )?;
        let (air, options) = session.model_conditions().map_err(|error| error.to_string())?;
        let options = options.ok_or("the scan's model is not supported by this version")?;
        let world = Arc::new(World::new(scene, session.sensor.clone(), air, options));
        Ok(Self { sweep, session, world })
    }
}

/// World and precomputed grid of the previous scan.
struct PreviousScan {
    session: Arc<Session>,
    world: Arc<World>,
    atlas: CoarseGrid,
}

/// Locates scans one after the other.
struct ScanLocator {
    course: Option<Tracker>,
    previous: Option<PreviousScan>,
}

impl ScanLocator {
    const fn new(course: Option<Tracker>) -> Self {
        Self { course, previous: None }
    }

    fn locate(&mut self, place: LocatableScan, watch: &dyn FitObserver) -> Location {
        let scan = place.sweep.scan;
        self.try_locate(place, watch).unwrap_or_else(|why| unlocated(scan, why))
    }

    fn try_locate(
        &mut self,
        place: LocatableScan,
        watch: &dyn FitObserver,
    ) -> Result<Location, String> {
        let LocatableScan { sweep, session, world } = place;
        // Only one atlas is kept, because each can have many megabytes.
        let previous =
            self.previous.take().filter(|previous| Arc::ptr_eq(&previous.session, &session));
        let previous = match previous {
            Some(previous) => previous,
            None => {
                let spacing_m = CoarseGrid::default_spacing_m(&world.scene);
                let atlas = CoarseGrid::observed(&world, spacing_m, watch);
                let atlas = atlas.map_err(|error| error.to_string())?;
                PreviousScan { session, world: Arc::clone(&world), atlas }
            }
        };
        let PreviousScan { atlas, .. } = self.previous.insert(previous);
        let poses = match &mut self.course {
            Some(course) => course.next_observed(&world, atlas, &sweep, watch),
            None => locate_observed(&world, atlas, &sweep, watch),
        };
        let poses = poses.map_err(|error| error.to_string())?;
        let diagnoses = diagnose(&world, atlas, &sweep, &poses);
        let causes = diagnoses.iter().map(|cause| format!("{cause}; {}", cause.advice())).collect();
        Ok(Location { scan: sweep.scan, poses, diagnoses, causes, unavailable_reason: None })
    }
}

/// Result for a scan that could not be located.
fn unlocated(scan: Uuid, why: String) -> Location {
    let (poses, diagnoses, causes) = (Vec::new(), Vec::new(), Vec::new());
    Location { scan, poses, diagnoses, causes, unavailable_reason: Some(why) }
}
