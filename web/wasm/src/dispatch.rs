//! Dispatch of requests.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};
use sonard_model::{acoustics::Sensor, model::EngineKind, scene::shipped};
use sonard_records::{FloorPlan, ScanView};
use sonard_wasm_module::{Dispatcher, encode, half_beam_deg};

use crate::{
    Request, RequestError,
    beam::Beam,
    log::{self, LoggedScan},
    setup::Setup,
    sweep::Sweep,
};

/// Request handler with its state: settings, running sweeps, and the scans of the last log.
#[derive(Default)]
pub struct ModelDispatcher {
    setup: Option<Setup>,
    /// Running sweeps by engine name.
    sweeps: BTreeMap<&'static str, Sweep>,
    log: Vec<ScanView>,
}

impl Dispatcher for ModelDispatcher {
    type Request = Request;

    fn dispatch(&mut self, request: Request) -> Result<String, RequestError> {
        match request {
            Request::ListPresets => encode(&presets()),
            Request::Configure { settings } => {
                let previous = self.setup.take();
                let setup = self.setup.insert(Setup::new(&settings, previous)?);
                self.sweeps.clear();
                let simulator = setup.simulator(EngineKind::Paths)?;
                let plan = FloorPlan::from_scene(&setup.scene);
                encode(&json!({ "plan": plan, "half_beam_deg": half_beam_deg(&simulator) }))
            }
            Request::StartSweep { engine, pose, plan, measured } => {
                let setup = self.setup.as_mut().ok_or_else(not_configured)?;
                setup.scene.check_pose(&pose)?;
                let simulator = setup.simulator(engine)?;
                let sweep = match measured {
                    None => Sweep::simulated(simulator, pose, plan)?,
                    Some(number) => {
                        let scan = self.log.get(number);
                        let scan =
                            scan.ok_or_else(|| RequestError::new("the log has no such scan", ""))?;
                        Sweep::measured(simulator, pose, scan)
                    }
                };
                let started = json!({
                    "start": &sweep.view.start, "session": &sweep.view.session,
                    "beams": sweep.remaining(),
                });
                self.sweeps.insert(engine.name(), sweep);
                encode(&started)
            }
            Request::NextReadings { engine, count } => {
                let sweep = self.sweep(engine)?;
                let readings = sweep.next_readings(count)?;
                encode(&Readings { readings: &readings, left: sweep.remaining() })
            }
            Request::Beam { engine, index } => encode(&Beam::new(self.sweep(engine)?, index)?),
            Request::LoadLog { text, pose } => {
                self.log = log::scans(&text, pose)?;
                let scans: Vec<_> = self.log.iter().map(LoggedScan::from).collect();
                encode(&json!({ "scans": scans }))
            }
        }
    }
}

impl ModelDispatcher {
    fn sweep(&mut self, engine: EngineKind) -> Result<&mut Sweep, RequestError> {
        let sweep = self.sweeps.get_mut(engine.name());
        sweep.ok_or_else(|| {
            RequestError::new(&format!("no sweep of the engine {}", engine.name()), "")
        })
    }
}

/// Part of a sweep.
#[derive(Serialize)]
struct Readings<'a, T> {
    readings: &'a [T],
    /// Number of readings not yet returned.
    left: usize,
}

fn not_configured() -> RequestError {
    RequestError::new("the model is not configured", "send `configure` first")
}

/// Built-in scenes as text, and sensor presets.
fn presets() -> Value {
    let scenes: Vec<_> =
        shipped::SCENES.iter().map(|(name, text)| json!({ "name": name, "text": text })).collect();
    let sensors: Vec<_> =
        Sensor::preset_names().filter_map(|name| Sensor::preset(name).ok()).collect();
    json!({ "scenes": scenes, "sensors": sensors })
}
