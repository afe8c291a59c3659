//! Survey of an unknown room from scans of the logs or uploaded sweeps.

use std::sync::{
    Arc, Mutex, PoisonError, Weak,
    atomic::{AtomicBool, Ordering},
};

use axum::{Json, extract::State, http::StatusCode, response::Response};
use sonard_api::{
    Accepted, AirOrder, FloorPlan, MAX_SURVEY_SCENES, MAX_SURVEYED_SWEEPS, MAX_UPLOADED_BEAMS,
    Problem, SurveyEvent, SurveyReport, SurveyRequest, UploadedSweep,
};
use sonard_inverse::{FiringOutcome, FitSweep, SweepFiring, World};
use sonard_log::ScanSpan;
use sonard_survey::{
    Survey, SurveyCourse, SurveyError, SurveyObserver, SurveyOptions, SurveyProgress, survey,
    unknown_room,
};
use tokio::sync::oneshot;
use uuid::Uuid;

use super::{
    findings::read,
    results::{ResultSender, acquire_permit, stream_results},
    scans::{find_written, internal_error},
};
use crate::{
    air_from_order,
    server::{
        Api,
        openapi::Route,
        response::{ApiError, JsonBody},
    },
};

/// Minimum number of beams of a sweep.
const MIN_BEAMS: usize = 8;

/// Cancellation flag of the running survey, if there is one.
pub(in crate::server) type RunningSurvey = Arc<Mutex<Weak<AtomicBool>>>;

pub(super) fn endpoints() -> Vec<Route> {
    vec![
        Route::post(
            "/v1/survey",
            start,
            "Floor plan and poses of an unknown room, reconstructed from scans or uploaded sweeps as by `sonard \
             survey`. The survey ends when the client disconnects; one client at a time",
        )
        .accepts::<SurveyRequest>()
        .responds_as::<SurveyEvent>(
            200,
            "application/x-ndjson",
            "Progress, one line for each stage, and finally the result",
        ),
        Route::delete(
            "/v1/survey",
            cancel,
            "End the running survey early; its response ends with the best plan so far",
        )
        .responds::<Accepted>(200, "Ending")
        .responds::<Problem>(409, "No survey is running"),
    ]
}

async fn start(
    State(api): State<Api>,
    JsonBody(request): JsonBody<SurveyRequest>,
) -> Result<Response, ApiError> {
    check_size(&request)?;
    let mut passages = Vec::with_capacity(request.scans.len());
    for scan in &request.scans {
        passages.push(find_written(&api, &scan.to_string()).await?);
    }
    let permit = acquire_permit(&api).await?;
    let is_uploaded = passages.is_empty();
    let (world, course) = match is_uploaded {
        true => uploaded(&api, &request)?,
        false => {
            let (max_range_m, spacing_m) = (request.max_range_m, request.round_spacing_m);
            let reading =
                tokio::task::spawn_blocking(move || logged(&passages, max_range_m, spacing_m));
            reading.await.map_err(|error| internal_error(&error))??
        }
    };
    let is_cancelled = Arc::new(AtomicBool::new(false));
    *api.surveying.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(&is_cancelled);
    let (began, has_begun) = oneshot::channel();
    let options = options(&request);
    let is_closed = request.closed;
    let response = stream_results("application/x-ndjson", permit, move |results| {
        let began = Mutex::new(Some(began));
        let observer = Observer { results, is_cancelled, began: &began };
        match survey(&world, &course, &options, &observer) {
            Ok(found) => {
                let _ =
                    results.send(&SurveyEvent::Result(Box::new(report(found, is_closed))), "\n");
            }
            Err(error) => observer.begin(Err(error)),
        }
    });
    // Invalid input ends a survey before its first stage.
    match has_begun.await {
        Ok(Ok(())) => Ok(response),
        Ok(Err(error)) => Err(survey_error(&error)),
        Err(_) => Err(super::super::internal_error()),
    }
}

async fn cancel(State(api): State<Api>) -> Result<Json<Accepted>, ApiError> {
    let running = api.surveying.lock().unwrap_or_else(PoisonError::into_inner).upgrade();
    let running = running.ok_or_else(|| {
        let help = "POST /v1/survey starts one";
        ApiError::new(StatusCode::CONFLICT, "no survey is running", help)
    })?;
    running.store(true, Ordering::Relaxed);
    Ok(Json(Accepted { accepted: true }))
}

fn check_size(request: &SurveyRequest) -> Result<(), ApiError> {
    let SurveyRequest { scans, sweeps, max_scenes, round_spacing_m, .. } = request;
    if !scans.is_empty() && !sweeps.is_empty() {
        let help = "send scans of the logs or uploaded sweeps, not both";
        return Err(invalid("scans and sweeps are both given", help, "sweeps".into()));
    }
    let count = scans.len().max(sweeps.len());
    // A scan of an array has many rounds.
    let min = if scans.is_empty() { 2 } else { 1 };
    if !(min..=MAX_SURVEYED_SWEEPS).contains(&count) {
        let help = format!("a survey takes 2 to {MAX_SURVEYED_SWEEPS}, from different places");
        let field = if sweeps.is_empty() { "scans" } else { "sweeps" };
        return Err(invalid(&format!("{count} {field}"), &help, field.into()));
    }
    if !(0.0..=5.0).contains(round_spacing_m) {
        let error = format!("round_spacing_m is {round_spacing_m}");
        return Err(invalid(&error, "from 0 to 5", "round_spacing_m".into()));
    }
    if !(1..=MAX_SURVEY_SCENES).contains(max_scenes) {
        let help = format!("from 1 to {MAX_SURVEY_SCENES}");
        return Err(invalid(&format!("max_scenes is {max_scenes}"), &help, "max_scenes".into()));
    }
    Ok(())
}

fn options(request: &SurveyRequest) -> SurveyOptions {
    SurveyOptions {
        odometry: (!request.no_odometry).then(|| request.odometry.unwrap_or_default()),
        square_deg: request.square.then_some(SurveyOptions::SQUARE_DEG),
        reflectance: request.reflectance,
        fit: request.fit.clone(),
        view_reach_m: request.view_reach_m,
        max_scenes: request.max_scenes,
        ..SurveyOptions::default()
    }
}

/// Reads the scans, with rounds of an array at a minimum distance in metres, and the conditions that
/// they share. Reads the disk.
fn logged(
    passages: &[ScanSpan],
    max_range_m: f64,
    spacing_m: f64,
) -> Result<(World, SurveyCourse), ApiError> {
    let unusable = |why: String| ApiError::new(StatusCode::CONFLICT, why, "leave this scan out");
    let mut course: Option<SurveyCourse> = None;
    let mut first = None;
    for passage in passages {
        let view = read(passage)?;
        let found = SurveyCourse::from_scan(&view).map_err(|error| unusable(error.to_string()))?;
        match &mut course {
            None => course = Some(found),
            Some(course) => course.extend(found).map_err(|error| survey_error(&error))?,
        }
        // Every sweep has a session.
        let Some(session) = view.session else { continue };
        if first.get_or_insert_with(|| Arc::clone(&session)).sensor != session.sensor {
            let help = "survey the scans of one sensor together";
            let error = format!("the sensor of scan {} differs from that of the first", view.scan);
            return Err(ApiError::new(StatusCode::CONFLICT, error, help));
        }
    }
    let (session, mut course) =
        first.zip(course).ok_or_else(|| unusable("the scans have no session".into()))?;
    course.thin(spacing_m);
    let (air, options) = session.model_conditions().map_err(|error| unusable(error.to_string()))?;
    let options = options.unwrap_or_default();
    let world = unknown_room(session.sensor.clone(), air, options, max_range_m);
    Ok((world.map_err(|error| survey_error(&error))?, course))
}

/// Checks uploaded sweeps, which are of the current sensor.
fn uploaded(api: &Api, request: &SurveyRequest) -> Result<(World, SurveyCourse), ApiError> {
    let next = api.daemon.next_scan();
    let order = AirOrder {
        temperature_c: next.air.temperature_c,
        humidity_percent: None,
        pressure_kpa: None,
    };
    let air = air_from_order(&order, next.air.humidity_percent, next.air.pressure_kpa)?;
    let (sensor, options) = (next.setup.sensor.clone(), next.setup.model.options.engine_options());
    let world = unknown_room(sensor, air, options, request.max_range_m);
    let us_per_m = 2e6 / air.sound_speed_m_s();
    let sweeps = request.sweeps.iter().enumerate();
    let sweeps = sweeps.map(|(at, sweep)| uploaded_sweep(at, sweep, us_per_m));
    let sweeps = SurveyCourse::Sweeps(sweeps.collect::<Result<_, _>>()?);
    Ok((world.map_err(|error| survey_error(&error))?, sweeps))
}

fn uploaded_sweep(at: usize, given: &UploadedSweep, us_per_m: f64) -> Result<FitSweep, ApiError> {
    let UploadedSweep { pose, azimuths_deg, ranges_m } = given;
    let reject = |field: &str, error: String, help: &str| {
        Err(invalid(&format!("sweeps[{at}]: {error}"), help, format!("sweeps[{at}].{field}")))
    };
    if ![pose.x_m, pose.y_m, pose.heading_deg].iter().all(|value| value.is_finite()) {
        return reject("pose", "the pose is not finite".into(), "give metres and degrees");
    }
    let (azimuths, ranges) = (azimuths_deg.len(), ranges_m.len());
    if azimuths != ranges {
        let error = format!("{ranges} ranges, but {azimuths} azimuths");
        return reject("ranges_m", error, "give a range, or null, for each azimuth");
    }
    if !(MIN_BEAMS..=MAX_UPLOADED_BEAMS).contains(&ranges) {
        let help = format!("give {MIN_BEAMS} to {MAX_UPLOADED_BEAMS}");
        return reject("ranges_m", format!("{ranges} ranges"), &help);
    }
    if let Some(azimuth_deg) = azimuths_deg.iter().find(|azimuth| azimuth.abs() > 1e6) {
        let error = format!("an azimuth is {azimuth_deg}");
        return reject("azimuths_deg", error, "give degrees from the heading");
    }
    if let Some(range_m) = ranges_m.iter().flatten().find(|range_m| **range_m <= 0.0) {
        let help = "ranges are positive, or null for no echo";
        return reject("ranges_m", format!("a range is {range_m}"), help);
    }
    let firing = |(azimuth_deg, range_m): (&f64, &Option<f64>)| SweepFiring {
        azimuth_deg: *azimuth_deg,
        outcome: range_m.map_or(FiringOutcome::NoEcho, |range_m| FiringOutcome::Echo {
            tof_us: range_m * us_per_m,
        }),
    };
    let beams = azimuths_deg.iter().zip(ranges_m).map(firing).collect();
    Ok(FitSweep { scan: Uuid::from_u128(at as u128), pose: *pose, beams })
}

fn invalid(error: &str, help: &str, field: String) -> ApiError {
    let problem = Problem { error: error.into(), help: help.into(), field: Some(field) };
    ApiError { status: StatusCode::UNPROCESSABLE_ENTITY, problem }
}

fn survey_error(error: &SurveyError) -> ApiError {
    let (status, help) = match error {
        SurveyError::Option { .. } | SurveyError::Group(_) | SurveyError::NotFittable { .. } => {
            (StatusCode::UNPROCESSABLE_ENTITY, "see `sonard survey --help`")
        }
        SurveyError::TooFewSweeps(_) => (StatusCode::UNPROCESSABLE_ENTITY, "send further sweeps"),
        SurveyError::TooManyRounds { .. } => {
            (StatusCode::UNPROCESSABLE_ENTITY, "send fewer scans, or raise round_spacing_m")
        }
        SurveyError::MixedCourse => (StatusCode::CONFLICT, "survey them separately"),
        SurveyError::NoArcs(_) => {
            (StatusCode::CONFLICT, "leave this scan out, or raise max_range_m")
        }
        SurveyError::World(_) | SurveyError::Scene(_) => {
            (StatusCode::CONFLICT, "check sensor and air of the scans")
        }
    };
    ApiError::new(status, error.to_string(), help)
}

/// Report of a survey; without scene if it found no wall.
fn report(survey: Survey, is_closed: bool) -> SurveyReport {
    let scene = survey.scene("survey", is_closed);
    let text = scene.text();
    let built = scene.build().ok();
    let floor_plan = built.as_ref().map(FloorPlan::from_scene);
    let scene = built.and_then(|_| serde_json::from_str(&text).ok());
    SurveyReport { survey, scene, floor_plan }
}

/// Observer of a survey: sends progress to the client, and ends the survey when the client
/// disconnects or cancels.
struct Observer<'a> {
    results: &'a ResultSender,
    is_cancelled: Arc<AtomicBool>,
    began: &'a Mutex<Option<oneshot::Sender<Result<(), SurveyError>>>>,
}

impl Observer<'_> {
    /// Reports once whether the survey has begun.
    fn begin(&self, outcome: Result<(), SurveyError>) {
        let began = self.began.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(began) = began {
            let _ = began.send(outcome);
        }
    }
}

impl SurveyObserver for Observer<'_> {
    fn progress(&self, progress: SurveyProgress) {
        self.results.offer_line(&SurveyEvent::Progress(progress));
        self.begin(Ok(()));
    }

    fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed) || self.results.is_closed()
    }
}
