//! What the model expects of a scan before it is taken.

use std::sync::Arc;

use axum::{Json, extract::State, http::StatusCode};
use jiff::Timestamp;
use sonard_api::{AirOrder, JudgedPing, PreviewRequest, WholeScan, Word};
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
    NextScan, check_device, check_plan, check_pose, ordered_air, ordered_sensor,
    server::{
        Api,
        answer::{Body, Failed},
        openapi::Endpoint,
    },
};

/// Most beams of a scan that is asked about.
const MOST_BEAMS: u32 = 4000;

pub(super) fn endpoints() -> Vec<Endpoint> {
    vec![
        Endpoint::post(
            "/v1/preview",
            preview,
            "What the model expects of a scan before it is taken. Nothing is changed by it",
        )
        .takes::<PreviewRequest>()
        .answers::<WholeScan>(200, "The scan, as the model would have it"),
    ]
}

async fn preview(
    State(api): State<Api>,
    Body(request): Body<PreviewRequest>,
) -> Result<Json<WholeScan>, Failed> {
    let wanted = Wanted::of(request, api.daemon.next_scan())?;
    // One after the other, also when clients leave meanwhile: asking the model takes its time.
    let turn = Arc::clone(&api.looking).acquire_owned().await;
    let asking = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        wanted.ask()
    });
    let answer = asking.await.map_err(|error| {
        let help = "this is a fault of the program";
        Failed::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string(), help)
    })?;
    answer.map(Json)
}

/// A scan that the model can be asked about.
struct Wanted {
    pose: Pose,
    plan: ScanPlan,
    air: Air,
    sensor: Sensor,
    options: Options,
    scene: Arc<Scene>,
    array: Option<Arc<RangerArray>>,
}

impl Wanted {
    fn of(request: PreviewRequest, next: NextScan) -> Result<Self, Failed> {
        let scene = next
            .scene
            .clone()
            .ok_or_else(|| conflict("there is no scene", "give the daemon one with place.scene"))?;
        let plan = plan(&request, &next)?;
        let pose = request.pose.unwrap_or(next.pose);
        check_pose(&pose, Some(&scene), next.array.as_deref())?;
        let (now, order) = (&next.air, request.air);
        let order = order.unwrap_or(AirOrder {
            temperature_c: now.temperature_c,
            humidity_percent: None,
            pressure_kpa: None,
        });
        let air = ordered_air(&order, now.humidity_percent, now.pressure_kpa)?;
        let mut sensor = next.setup.sensor.clone();
        if let Some(order) = request.sensor {
            let of_array = next.array.is_some();
            sensor = ordered_sensor(&order, &next.setup, of_array, air.sound_speed_m_s())?;
            if let Some(device) = &next.device {
                check_device(&sensor, &next.setup.sensor, device)?;
            }
        }
        let options = next.setup.model.options.options_of_engine();
        Ok(Self { pose, plan, air, sensor, options, scene, array: next.array })
    }

    fn ask(self) -> Result<WholeScan, Failed> {
        match self.array.clone() {
            None => self.ask_ranger(),
            Some(array) => self.ask_array(array),
        }
    }

    fn ask_ranger(self) -> Result<WholeScan, Failed> {
        let scene = Arc::new(self.scene.with_robot_at(&self.pose));
        let simulator = Simulator::new(scene, self.sensor, self.air, self.options)
            .map_err(|error| refused(&error))?;
        let (id, time) = (Uuid::new_v4(), Timestamp::now());
        let view = ScanView::simulated(&simulator, id, &self.pose, &self.plan, time)
            .map_err(|error| refused(&error))?;
        Ok(whole(view, Session::simulated(&simulator, time)))
    }

    /// A round of an array's rangers, each as if the robot stood still.
    fn ask_array(self, array: Arc<RangerArray>) -> Result<WholeScan, Failed> {
        let rangers: Vec<usize> = array.round().collect();
        let model = ArrayModel::new(array, &self.scene, &self.sensor, self.air, self.options)
            .map_err(|error| refused(&error))?;
        let stand = model.at(self.pose).map_err(|error| refused(&error))?;
        let (id, time) = (Uuid::new_v4(), Timestamp::now());
        let fire = |(firing, ranger): (usize, usize)| {
            let prediction = stand.ping_in_round(firing)?;
            Ok(Ping::of_array(&stand, id, &self.pose, firing as u32, ranger, &prediction))
        };
        let pings = rangers.iter().copied().enumerate().map(fire);
        let pings = pings.collect::<Result<_, TooCostly>>().map_err(|error| refused(&error))?;
        let session = Session::of_array(&model, time);
        let view = ScanView {
            scan: id,
            session: Some(Arc::new(session.clone())),
            start: Some(ScanStart::of_array(&model, id, self.pose, 1, time)),
            pings,
            events: Vec::new(),
            end: None,
        };
        Ok(whole(view, session))
    }
}

/// Azimuths, few enough.
fn plan(request: &PreviewRequest, next: &NextScan) -> Result<ScanPlan, Failed> {
    let array = next.array.as_ref();
    let plan = request.plan.or_else(|| Some(array?.plan(1))).unwrap_or(next.plan);
    if request.plan.is_some() {
        check_plan(&plan, array.is_some(), next.device.as_ref())?;
    }
    if plan.beams() > MOST_BEAMS {
        let error = format!("the plan has {} beams", plan.beams());
        return Err(wrong(error, "ask about 4000 or fewer: a greater step_deg"));
    }
    Ok(plan)
}

fn conflict(error: impl std::fmt::Display, help: impl Into<String>) -> Failed {
    Failed::new(StatusCode::CONFLICT, error.to_string(), help)
}

fn wrong(error: String, help: &str) -> Failed {
    Failed::new(StatusCode::UNPROCESSABLE_ENTITY, error, help)
}

fn refused(error: &dyn std::fmt::Display) -> Failed {
    conflict(error, "a smaller model.max_range_m, or the engine cone")
}

/// A scan of the model's with its verdicts, without the text of its scene.
fn whole(mut view: ScanView, session: Session) -> WholeScan {
    let pings = std::mem::take(&mut view.pings);
    let pings = pings.into_iter().map(|ping| judged(ping, &view)).collect();
    let session = Some(Arc::new(Session { scene_text: None, ..session }));
    let ScanView { start, events, end, .. } = view;
    WholeScan { session, start, pings, events, end }
}

/// A reading of the model's, which the model explains.
fn judged(ping: Ping, view: &ScanView) -> JudgedPing {
    let sim = SimRecord {
        status: ping.status,
        range_m: ping.range_m,
        amplitude: ping.amplitude,
        margin_db: ping.margin_db,
        path: ping.path.clone(),
        crosstalk: ping.crosstalk.clone(),
    };
    let verdict = Word::of(&Ping { sim: Some(sim), ..ping.clone() });
    let mut judged = JudgedPing::of(ping, view);
    judged.beside.verdict = verdict;
    judged
}
