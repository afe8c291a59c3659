//! Dispatch of requests.

use serde_json::json;
use sonard_inverse::FitSweep;
use sonard_model::{acoustics::Air, model::Options};
use sonard_records::FloorPlan;
use sonard_survey::{Survey, SurveyError, SurveyOptions, survey, unknown_room};
use sonard_wasm_module::{Dispatcher, RequestError, encode, half_beam_deg};

use crate::{
    Request,
    comparison::RevealedFigures,
    progress::PageObserver,
    sweep::{MAX_RANGE_M, MAX_STOPS, Sweep, drive, sensor, take_sweep, world_of},
};

/// Maximum number of floor plans that a survey scores.
const MAX_SCENES: usize = 6000;

/// Request handler, without state.
#[derive(Debug, Default)]
pub struct SurveyDispatcher;

impl Dispatcher for SurveyDispatcher {
    type Request = Request;

    fn dispatch(&mut self, request: Request) -> Result<String, RequestError> {
        match request {
            Request::OpenRoom { room } => {
                let (scene, start) = room.open()?;
                let plan = FloorPlan::from_scene(&scene);
                let simulator = world_of(scene)?
                    .simulator(&start)
                    .map_err(|error| RequestError::new(&error, ""))?;
                let half_beam_deg = half_beam_deg(&simulator);
                encode(&json!({ "plan": plan, "start": start, "half_beam_deg": half_beam_deg }))
            }
            Request::Drive { by, seed, number } => encode(&drive(by, seed, number)),
            Request::TakeSweep { room, pose, seed, number } => {
                encode(&json!({ "readings": take_sweep(room.open()?.0, &pose, seed, number)? }))
            }
            Request::Survey { sweeps } => encode(&run_survey(&sweeps)?),
            Request::Compare { room, course, survey } => {
                encode(&RevealedFigures::new(&survey, &room.open()?.0, &course))
            }
        }
    }
}

fn run_survey(sweeps: &[Sweep]) -> Result<Survey, RequestError> {
    if sweeps.len() > MAX_STOPS {
        let help = format!("a survey takes at most {MAX_STOPS}");
        return Err(RequestError::new(&format!("{} sweeps", sweeps.len()), help));
    }
    let numbered = (1..).zip(sweeps);
    let sweeps: Vec<FitSweep> =
        numbered.map(|(number, sweep)| sweep.to_fit(number)).collect::<Result<_, _>>()?;
    let world = unknown_room(sensor()?, Air::default(), Options::default(), MAX_RANGE_M);
    let options = SurveyOptions { max_scenes: MAX_SCENES, ..SurveyOptions::default() };
    let found = world.and_then(|world| survey(&world, &sweeps, &options, &PageObserver));
    found.map_err(|error| survey_error(&error))
}

fn survey_error(error: &SurveyError) -> RequestError {
    match error {
        SurveyError::TooFewSweeps(_) => RequestError::new(error, "drive on and take another sweep"),
        SurveyError::NoArcs(scan) => {
            let number = scan.as_u128();
            let message =
                format!("sweep {number} has no arc of equal ranges, so its pose is unknown");
            RequestError::new(&message, "sweep where walls are within 4 m")
        }
        _ => RequestError::new(error, ""),
    }
}
