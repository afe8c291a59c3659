//! Where scans were taken: one by itself, or a course of them.

use std::{
    io,
    num::NonZero,
    sync::{Arc, PoisonError},
    thread,
    time::Duration,
};

use axum::{
    body::{Body, Bytes},
    extract::State,
    http::{StatusCode, header},
    response::{IntoResponse as _, Response},
};
use futures_util::stream;
use serde::Deserialize;
use serde_json::json;
use sonard_api::Location;
use sonard_inverse::{Atlas, Course, Odometry, Sweep, Watch, World, doubts, locate_watched};
use sonard_log::{History, Passage};
use sonard_records::Session;
use tokio::{
    sync::{OwnedSemaphorePermit, mpsc},
    task::JoinHandle,
    time::timeout,
};
use uuid::Uuid;

use super::{
    findings::read,
    scans::{broken, find_written, in_history, no_such_scan, taken_in},
};
use crate::server::{
    Api,
    answer::{Failed, Path, Query},
    openapi::Endpoint,
};

/// Most scans of a course.
const MOST_SCANS: usize = 500;
/// How long to wait until others have been answered.
const TURN: Duration = Duration::from_secs(5);

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Way {
    #[serde(default)]
    to: Option<Uuid>,
    #[serde(default)]
    drift_m_per_m: Option<f64>,
    #[serde(default)]
    drift_deg_per_m: Option<f64>,
    #[serde(default)]
    carried: Option<f64>,
}

pub(super) fn endpoints() -> Vec<Endpoint> {
    let uuid = || json!({"type": "string", "format": "uuid"});
    let up_to = |most: f64| json!({"type": "number", "minimum": 0, "maximum": most});
    vec![
        Endpoint::get(
            "/v1/scans/{scan}/location",
            location,
            "Where a scan was taken, by its readings alone, as `sonard locate` finds it. Of at most 4000 readings; for \
             one client at a time",
        )
        .parameter("path", "scan", uuid(), "A scan from GET /v1/scans, or the one under way")
        .answers::<Location>(200, "All poses that explain it, most probable first"),
        Endpoint::get(
            "/v1/scans/{scan}/course",
            course,
            "Where a scan and those after it were taken, with the poses in the log as odometry's, as `sonard locate \
             --course` finds it. At most 500 scans; for one client at a time",
        )
        .parameter("path", "scan", uuid(), "The first scan of the course, from GET /v1/scans")
        .parameter("query", "to", uuid(), "Its last scan; without it, the newest")
        .parameter(
            "query",
            "drift_m_per_m",
            up_to(1.0),
            "Standard deviation of odometry's position for each metre driven, metres; without it, 0.05",
        )
        .parameter(
            "query",
            "drift_deg_per_m",
            up_to(180.0),
            "Standard deviation of odometry's heading for each metre driven, degrees; without it, 5",
        )
        .parameter(
            "query",
            "carried",
            up_to(1.0),
            "Probability that the robot was carried elsewhere between two scans; without it, 0.02",
        )
        .answers_as::<Location>(
            200,
            "application/x-ndjson",
            "One scan a line, as soon as it is located",
        ),
    ]
}

async fn location(State(api): State<Api>, Path(scan): Path<String>) -> Result<Response, Failed> {
    let passage = find_written(&api, &scan).await?;
    let turn = turn(&api).await?;
    let asked = api.clone();
    let reading = tokio::task::spawn_blocking(move || Located::of(&asked, &passage, None));
    let place = reading
        .await
        .map_err(|error| broken(&error))?
        .map_err(|why| Failed::new(StatusCode::CONFLICT, why, "see `sonard locate --help`"))?;
    Ok(answer("application/json", turn, move |answers| {
        let mut locator = Locator::new(None);
        let _ = answers.tell(&locator.locate(place, answers), "");
    }))
}

async fn course(
    State(api): State<Api>,
    Path(scan): Path<String>,
    Query(way): Query<Way>,
) -> Result<Response, Failed> {
    let odometry = odometry(way)?;
    let from = Uuid::parse_str(&scan).map_err(|_| no_such_scan())?;
    let find = move |history: &mut History| scans_between(history, from, way.to);
    let scans = in_history(&api, find).await?.ok_or_else(|| {
        let error = format!("of the {MOST_SCANS} scans up to the last none is {from}");
        Failed::new(StatusCode::NOT_FOUND, error, "see GET /v1/scans, newest first")
    })?;
    let turn = turn(&api).await?;
    Ok(answer("application/x-ndjson", turn, move |answers| {
        let mut locator = Locator::new(Some(Course::new(odometry)));
        // Whoever has gone wants no more.
        let _ = scans.into_iter().try_for_each(|scan| {
            let location = match place(&api, scan, &locator) {
                Ok(place) => locator.locate(place, answers),
                Err(why) => lacking(scan, why),
            };
            answers.tell(&location, "\n")
        });
    }))
}

fn odometry(way: Way) -> Result<Odometry, Failed> {
    let usual = Odometry::default();
    let within = |name: &str, given: Option<f64>, usual: f64, most: f64| {
        let value = given.unwrap_or(usual);
        (0.0..=most).contains(&value).then_some(value).ok_or_else(|| {
            let help = format!("from 0 to {most}");
            Failed::new(StatusCode::UNPROCESSABLE_ENTITY, format!("{name} is {value}"), help)
        })
    };
    Ok(Odometry {
        drift_m_per_m: within("drift_m_per_m", way.drift_m_per_m, usual.drift_m_per_m, 1.0)?,
        drift_deg_per_m: within(
            "drift_deg_per_m",
            way.drift_deg_per_m,
            usual.drift_deg_per_m,
            180.0,
        )?,
        carried: within("carried", way.carried, usual.carried, 1.0)?,
    })
}

/// The scans from one to another, or to the newest, oldest first; `None` where there is no such way.
fn scans_between(
    history: &mut History,
    from: Uuid,
    to: Option<Uuid>,
) -> io::Result<Option<Vec<Uuid>>> {
    let mut scans: Vec<Uuid> = to.into_iter().collect();
    let most = MOST_SCANS - scans.len();
    let before = match to {
        None => history.newest(most)?,
        Some(to) => match history.before(to, most)? {
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

/// Leave to locate: one client at a time, because it takes a processor for seconds.
async fn turn(api: &Api) -> Result<OwnedSemaphorePermit, Failed> {
    let turn = timeout(TURN, Arc::clone(&api.locating).acquire_owned()).await;
    turn.ok().and_then(Result::ok).ok_or_else(|| {
        let help = "try again later: scans are located for one client at a time";
        Failed::new(StatusCode::SERVICE_UNAVAILABLE, "another client has scans located", help)
    })
}

/// Answers with what `work` tells, beside everything else, as long as the client takes it.
fn answer(
    media: &'static str,
    turn: OwnedSemaphorePermit,
    work: impl FnOnce(&Answers) + Send + 'static,
) -> Response {
    let (sender, receiver) = mpsc::channel(1);
    let working = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        let answers = Answers(sender);
        // One processor is left to who measures.
        let threads = thread::available_parallelism().map_or(1, NonZero::get).saturating_sub(1);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build();
        match pool {
            Ok(pool) => pool.install(|| work(&answers)),
            Err(_) => work(&answers),
        }
    });
    let pieces = stream::try_unfold((receiver, working), next_piece);
    ([(header::CONTENT_TYPE, media)], Body::from_stream(pieces)).into_response()
}

type Coming = (mpsc::Receiver<Bytes>, JoinHandle<()>);

/// What is told next; that the work broke off is no end.
async fn next_piece((mut receiver, working): Coming) -> io::Result<Option<(Bytes, Coming)>> {
    match receiver.recv().await {
        Some(piece) => Ok(Some((piece, (receiver, working)))),
        None => working.await.map(|()| None).map_err(io::Error::other),
    }
}

/// Where answers go.
struct Answers(mpsc::Sender<Bytes>);

impl Answers {
    /// Tells one; `None` where nobody listens any more.
    fn tell(&self, location: &Location, end: &str) -> Option<()> {
        let line = serde_json::to_string(location).ok()? + end;
        self.0.blocking_send(line.into()).ok()
    }
}

impl Watch for Answers {
    fn stops(&self) -> bool {
        self.0.is_closed()
    }
}

/// A scan, and the world in which it was taken.
struct Located {
    sweep: Sweep,
    session: Arc<Session>,
    world: Arc<World>,
}

/// What can be located of a scan of the logs.
fn place(api: &Api, scan: Uuid, locator: &Locator) -> Result<Located, String> {
    let found = api.history.lock().unwrap_or_else(PoisonError::into_inner).passage(scan);
    let passage = found.map_err(|error| format!("cannot read the logs: {error}"))?;
    let passage = passage.ok_or("the newest logs have no such scan")?;
    Located::of(api, &passage, locator.known.as_ref())
}

impl Located {
    /// What can be located of a scan, or why nothing can. The world of the previous scan is reused if the session is the
    /// same. Reads the disk.
    fn of(api: &Api, passage: &Passage, known: Option<&Known>) -> Result<Self, String> {
        let view = read(passage).map_err(|failed| failed.problem.error)?;
        let sweep = Sweep::of(&view).map_err(|error| error.to_string())?;
        let session = view.session.ok_or("the log lacks the scan's session")?;
        if let Some(known) = known.filter(|known| *known.session == *session) {
            let (session, world) = (Arc::clone(&known.session), Arc::clone(&known.world));
            return Ok(Self { sweep, session, world });
        }
        let scene = taken_in(api.daemon.scene(), passage);
        let is_own = session.scene.as_ref();
        let scene = scene
            .filter(|scene| is_own.is_none_or(|own| own.sha256 == scene.sha256))
            .ok_or("the log does not hold the scan's scene, and none such is in force")?;
        let (air, options) = session.conditions().map_err(|error| error.to_string())?;
        let options = options.ok_or("the scan's model is unknown here")?;
        let world = Arc::new(World::new(scene, session.sensor.clone(), air, options));
        Ok(Self { sweep, session, world })
    }
}

/// The world of the scan that was located last, with its readings on a grid.
struct Known {
    session: Arc<Session>,
    world: Arc<World>,
    atlas: Atlas,
}

/// Locates scan after scan.
struct Locator {
    course: Option<Course>,
    known: Option<Known>,
}

impl Locator {
    const fn new(course: Option<Course>) -> Self {
        Self { course, known: None }
    }

    fn locate(&mut self, place: Located, watch: &dyn Watch) -> Location {
        let scan = place.sweep.scan;
        self.found(place, watch).unwrap_or_else(|why| lacking(scan, why))
    }

    fn found(&mut self, place: Located, watch: &dyn Watch) -> Result<Location, String> {
        let Located { sweep, session, world } = place;
        // One atlas at a time: each may have megabytes.
        let known = self.known.take().filter(|known| Arc::ptr_eq(&known.session, &session));
        let known = match known {
            Some(known) => known,
            None => {
                let spacing_m = Atlas::usual_spacing_m(&world.scene);
                let atlas = Atlas::watched(&world, spacing_m, watch);
                let atlas = atlas.map_err(|error| error.to_string())?;
                Known { session, world: Arc::clone(&world), atlas }
            }
        };
        let Known { atlas, .. } = self.known.insert(known);
        let poses = match &mut self.course {
            Some(course) => course.next_watched(&world, atlas, &sweep, watch),
            None => locate_watched(&world, atlas, &sweep, watch),
        };
        let poses = poses.map_err(|error| error.to_string())?;
        let doubts = doubts(&world, atlas, &sweep, &poses);
        Ok(Location { scan: sweep.scan, poses, doubts, lacks: None })
    }
}

/// A scan that could not be located.
const fn lacking(scan: Uuid, why: String) -> Location {
    Location { scan, poses: Vec::new(), doubts: Vec::new(), lacks: Some(why) }
}
