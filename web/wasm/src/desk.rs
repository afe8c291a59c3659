//! Where requests are answered.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};
use sonard_model::{acoustics::Sensor, model::EngineKind, scene::shipped};
use sonard_records::{FloorPlan, ScanView};

use crate::{
    Refusal, Request,
    beam::Beam,
    log::{self, Found},
    setup::Setup,
    sweep::Sweep,
};

/// Settings, sweeps under way, and the log that was read last.
#[derive(Default)]
pub struct Desk {
    setup: Option<Setup>,
    /// By the engine's name.
    sweeps: BTreeMap<&'static str, Sweep>,
    log: Vec<ScanView>,
}

impl Desk {
    /// The answer to a request, both JSON.
    pub fn answer(&mut self, request: &[u8]) -> String {
        let told = serde_json::from_slice(request)
            .map_err(|error| Refusal::new(&format!("no request: {error}"), ""))
            .and_then(|request| self.tell(request));
        told.unwrap_or_else(|refused| json!({ "refused": refused }).to_string())
    }

    fn tell(&mut self, request: Request) -> Result<String, Refusal> {
        match request {
            Request::Shipped => text(&shipped_things()),
            Request::Set { settings } => {
                let before = self.setup.take();
                let setup = self.setup.insert(Setup::new(&settings, before)?);
                self.sweeps.clear();
                let simulator = setup.simulator(EngineKind::Paths)?;
                // Where a wall, there and back, is heard half as strongly as straight ahead.
                let half_beam_deg = simulator.beam().angle_at(0.5_f64.sqrt()).to_degrees();
                let plan = FloorPlan::of(&setup.scene);
                text(&json!({ "plan": plan, "half_beam_deg": half_beam_deg }))
            }
            Request::Stand { engine, pose, plan, measured } => {
                let setup = self.setup.as_mut().ok_or_else(unset)?;
                setup.scene.check_pose(&pose)?;
                let simulator = setup.simulator(engine)?;
                let sweep = match measured {
                    None => Sweep::modelled(simulator, pose, plan)?,
                    Some(scan) => {
                        let scan = self.log.get(scan);
                        let scan =
                            scan.ok_or_else(|| Refusal::new("the log has no such scan", ""))?;
                        Sweep::measured(simulator, pose, scan)
                    }
                };
                let began = json!({
                    "start": &sweep.view.start, "session": &sweep.view.session, "beams": sweep.left(),
                });
                self.sweeps.insert(engine.name(), sweep);
                text(&began)
            }
            Request::More { engine, count } => {
                let sweep = self.sweep(engine)?;
                let readings = sweep.more(count)?;
                text(&More { readings: &readings, left: sweep.left() })
            }
            Request::Beam { engine, index } => text(&Beam::of(self.sweep(engine)?, index)?),
            Request::Log { text: file, pose } => {
                self.log = log::scans(&file, pose)?;
                let scans: Vec<_> = self.log.iter().map(Found::of).collect();
                text(&json!({ "scans": scans }))
            }
        }
    }

    fn sweep(&mut self, engine: EngineKind) -> Result<&mut Sweep, Refusal> {
        let sweep = self.sweeps.get_mut(engine.name());
        sweep.ok_or_else(|| Refusal::new(&format!("{} has no sweep", engine.name()), ""))
    }
}

/// Part of a sweep.
#[derive(Serialize)]
struct More<'a, T> {
    readings: &'a [T],
    left: usize,
}

fn unset() -> Refusal {
    Refusal::new("there are no settings yet", "")
}

fn text(answer: &impl Serialize) -> Result<String, Refusal> {
    serde_json::to_string(answer).map_err(|error| Refusal::new(&error, ""))
}

/// Scenes with their texts and sensors with their data.
fn shipped_things() -> Value {
    let scenes: Vec<_> =
        shipped::SCENES.iter().map(|(name, text)| json!({ "name": name, "text": text })).collect();
    let sensors: Vec<_> =
        Sensor::preset_names().filter_map(|name| Sensor::preset(name).ok()).collect();
    json!({ "scenes": scenes, "sensors": sensors })
}
