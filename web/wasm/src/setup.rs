//! Settings in force: the scene, and a simulator for each engine that was asked for.

use std::{
    collections::{BTreeMap, btree_map::Entry},
    sync::Arc,
};

use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::{EngineKind, OptionKeys, Simulator},
    scene::Scene,
};

use crate::{
    Refusal,
    request::{AirChoice, SensorChoice, Settings},
};

/// Settings, and what was made of them so far.
pub(crate) struct Setup {
    pub(crate) scene: Arc<Scene>,
    sensor: Sensor,
    air: Air,
    options: OptionKeys,
    /// By the engine's name. Kept while only the scene changes: receiver and beam pattern take longer to make
    /// than a room's plan.
    simulators: BTreeMap<&'static str, Arc<Simulator>>,
}

impl Setup {
    /// Of settings; what an earlier setup made of the same sensor, air and options is taken over.
    pub(crate) fn new(settings: &Settings, before: Option<Self>) -> Result<Self, Refusal> {
        let scene = Arc::new(Scene::from_json(&settings.scene)?);
        let sensor = match &settings.sensor {
            SensorChoice::Preset(name) => Sensor::preset(name)?,
            SensorChoice::Data(data) => (**data).clone(),
        };
        sensor.check()?;
        let air = air(&settings.air)?;
        let options = settings.options;
        let mut setup = Self { scene, sensor, air, options, simulators: BTreeMap::new() };
        if let Some(before) = before
            && (&before.sensor, before.air, before.options)
                == (&setup.sensor, setup.air, setup.options)
        {
            for (name, simulator) in before.simulators {
                let simulator = simulator.in_scene(Arc::clone(&setup.scene))?;
                setup.simulators.insert(name, Arc::new(simulator));
            }
        }
        // What is wrong with sensor and options is found now, not with the first sweep.
        setup.simulator(EngineKind::Paths)?;
        Ok(setup)
    }

    /// The simulator of an engine in the scene without the robot that carries the ranger.
    pub(crate) fn simulator(&mut self, engine: EngineKind) -> Result<Arc<Simulator>, Refusal> {
        match self.simulators.entry(engine.name()) {
            Entry::Occupied(made) => Ok(Arc::clone(made.get())),
            Entry::Vacant(place) => {
                let options = OptionKeys { engine, ..self.options }.options_of_engine();
                let scene = Arc::clone(&self.scene);
                let made = Simulator::new(scene, self.sensor.clone(), self.air, options)?;
                Ok(Arc::clone(place.insert(Arc::new(made))))
            }
        }
    }
}

/// A simulator with the scene's robot at a pose, if the scene has one.
pub(crate) fn around(simulator: &Arc<Simulator>, robot: &Pose) -> Result<Arc<Simulator>, Refusal> {
    if simulator.scene().robot.is_none() {
        return Ok(Arc::clone(simulator));
    }
    let scene = simulator.scene().with_robot_at(robot);
    Ok(Arc::new(simulator.in_scene(Arc::new(scene))?))
}

/// The air that was chosen.
pub(crate) fn air(choice: &AirChoice) -> Result<Air, Refusal> {
    let air = Air::new(choice.temperature_c, choice.humidity_percent, choice.pressure_kpa)?;
    Ok(match choice.sound_speed_m_s {
        None => air,
        Some(given) => air.with_sound_speed(given)?,
    })
}
