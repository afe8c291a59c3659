//! Preview: prediction of a scan before it is taken.

use std::sync::Arc;

use axum::{Json, extract::State, http::StatusCode};
use jiff::Timestamp;
use sonard_api::{AirOrder, AnnotatedPing, Classification, SettingsOrder, WholeScan};
use sonard_model::{
    acoustics::{Air, Sensor},
    array::RangerArray,
    geometry::Pose,
    model::{ArrayModel, Options, Simulator, TooCostly},
    scene::Scene,
};
use sonard_records::{Ping, ScanPlan, ScanStart, ScanView, Session, SimRecord};
use uuid::Uuid;

use crate::{
    NextScan, air_from_order, check_device, check_plan, check_pose, sensor_from_order,
    server::{
        Api,
        openapi::Route,
        response::{ApiError, JsonBody},
    },
};

/// Maximum number of beams of a preview.
const MAX_BEAMS: u32 = 4000;

pub(super) fn endpoints() -> Vec<Route> {
    vec![
        Route::post(
            "/v1/preview",
            preview,
            "Predict a scan before it is taken. Changes no settings",
        )
        .accepts::<SettingsOrder>()
        .responds::<WholeScan>(200, "The predicted scan"),
    ]
}

async fn preview(
    State(api): State<Api>,
    JsonBody(request): JsonBody<SettingsOrder>,
) -> Result<Json<WholeScan>, ApiError> {
    let scan = HypotheticalScan::new(request, api.daemon.next_scan())?;
    // One prediction at a time, even if clients disconnect meanwhile, because predictions take
    // long.
    let permit = Arc::clone(&api.predicting).acquire_owned().await;
    let predicting = tokio::task::spawn_blocking(move || {
        let _permit = permit;
        scan.predict()
    });
    let preview = predicting.await.map_err(|error| {
        let help = "this is a bug: see the log messages of the daemon";
        ApiError::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string(), help)
    })?;
    preview.map(Json)
}

/// Settings of a hypothetical scan.
struct HypotheticalScan {
    pose: Pose,
    plan: ScanPlan,
    air: Air,
    sensor: Sensor,
    options: Options,
    scene: Arc<Scene>,
    array: Option<Arc<RangerArray>>,
}

impl HypotheticalScan {
    fn new(request: SettingsOrder, next: NextScan) -> Result<Self, ApiError> {
        let scene = next
            .scene
            .clone()
            .ok_or_else(|| conflict("no scene is configured", "configure one in place.scene"))?;
        let plan = plan(&request, &next)?;
        let pose = request.pose.unwrap_or(next.pose);
        check_pose(&pose, Some(&scene), next.array.as_deref())?;
        let (current, order) = (&next.air, request.air);
        let order = order.unwrap_or(AirOrder {
            temperature_c: current.temperature_c,
            humidity_percent: None,
            pressure_kpa: None,
        });
        let air = air_from_order(&order, current.humidity_percent, current.pressure_kpa)?;
        let mut sensor = next.setup.sensor.clone();
        if let Some(order) = request.sensor {
            let of_array = next.array.is_some();
            sensor = sensor_from_order(&order, &next.setup, of_array, air.sound_speed_m_s())?;
            if let Some(device) = &next.device {
                check_device(&sensor, &next.setup.sensor, device)?;
            }
        }
        let options = next.setup.model.options.engine_options();
        Ok(Self { pose, plan, air, sensor, options, scene, array: next.array })
    }

    fn predict(self) -> Result<WholeScan, ApiError> {
        match self.array.clone() {
            None => self.predict_ranger(),
            Some(array) => self.predict_array(array),
        }
    }

    fn predict_ranger(self) -> Result<WholeScan, ApiError> {
        let scene = Arc::new(self.scene.with_robot_at(&self.pose));
        let simulator = Simulator::new(scene, self.sensor, self.air, self.options)
            .map_err(|error| model_error(&error))?;
        let (id, time) = (Uuid::new_v4(), Timestamp::now());
        let view = ScanView::simulated(&simulator, id, &self.pose, &self.plan, time)
            .map_err(|error| model_error(&error))?;
        Ok(preview_response(view, Session::simulated(&simulator, time)))
    }

    /// Predicts one round of an array's rangers for a stationary robot.
    fn predict_array(self, array: Arc<RangerArray>) -> Result<WholeScan, ApiError> {
        let rangers: Vec<usize> = array.round().collect();
        let model = ArrayModel::new(array, &self.scene, &self.sensor, self.air, self.options)
            .map_err(|error| model_error(&error))?;
        let point = model.at(self.pose).map_err(|error| model_error(&error))?;
        let (id, time) = (Uuid::new_v4(), Timestamp::now());
        let fire = |(firing, ranger): (usize, usize)| {
            let prediction = point.ping_in_round(firing)?;
            Ok(Ping::for_array(&point, id, &self.pose, firing as u32, ranger, &prediction))
        };
        let pings = rangers.iter().copied().enumerate().map(fire);
        let pings = pings.collect::<Result<_, TooCostly>>().map_err(|error| model_error(&error))?;
        let session = Session::for_array(&model, time);
        let view = ScanView {
            scan: id,
            session: Some(Arc::new(session.clone())),
            start: Some(ScanStart::for_array(&model, id, self.pose, 1, time)),
            pings,
            events: Vec::new(),
            end: None,
        };
        Ok(preview_response(view, session))
    }
}

/// Returns the requested plan, checked against the limit of beams.
fn plan(request: &SettingsOrder, next: &NextScan) -> Result<ScanPlan, ApiError> {
    let array = next.array.as_ref();
    let plan = request.plan.or_else(|| Some(array?.plan(1))).unwrap_or(next.plan);
    if request.plan.is_some() {
        check_plan(&plan, array.is_some(), next.device.as_ref())?;
    }
    if plan.beams() > MAX_BEAMS {
        let error = format!("the plan has {} beams", plan.beams());
        return Err(unprocessable(error, "at most 4000 beams: increase step_deg"));
    }
    Ok(plan)
}

fn conflict(error: impl std::fmt::Display, help: impl Into<String>) -> ApiError {
    ApiError::new(StatusCode::CONFLICT, error.to_string(), help)
}

fn unprocessable(error: String, help: &str) -> ApiError {
    ApiError::new(StatusCode::UNPROCESSABLE_ENTITY, error, help)
}

fn model_error(error: &dyn std::fmt::Display) -> ApiError {
    conflict(error, "reduce model.max_range_m, or use the engine cone")
}

/// Converts a simulated scan to a response with verdicts, without the text of its scene.
fn preview_response(mut view: ScanView, session: Session) -> WholeScan {
    let pings = std::mem::take(&mut view.pings);
    let pings = pings.into_iter().map(|ping| annotate(ping, &view)).collect();
    let session = Some(Arc::new(Session { scene_text: None, ..session }));
    let ScanView { start, events, end, .. } = view;
    WholeScan { session, start, pings, events, end }
}

/// Annotates a simulated reading, which agrees with the model by definition.
fn annotate(ping: Ping, view: &ScanView) -> AnnotatedPing {
    let sim = SimRecord {
        status: ping.status,
        range_m: ping.range_m,
        amplitude: ping.amplitude,
        margin_db: ping.margin_db,
        path: ping.path.clone(),
        crosstalk: ping.crosstalk.clone(),
    };
    let verdict = Classification::from_ping(&Ping { sim: Some(sim), ..ping.clone() });
    let mut annotated = AnnotatedPing::new(ping, view);
    annotated.annotations.verdict = verdict;
    annotated
}
