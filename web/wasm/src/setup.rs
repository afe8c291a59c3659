//! Configured settings with one simulator per engine, created on first use.

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
    RequestError,
    request::{AirChoice, SensorChoice, Settings},
};

/// Configured settings and the simulators created from them.
pub(crate) struct Setup {
    pub(crate) scene: Arc<Scene>,
    sensor: Sensor,
    air: Air,
    options: OptionKeys,
    /// Simulators by engine name. They are kept while only the scene changes, because creating
    /// receiver and beam pattern takes longer than preparing a scene.
    simulators: BTreeMap<&'static str, Arc<Simulator>>,
}

impl Setup {
    /// Creates a setup, reusing the simulators of the previous one if sensor, air and options are
    /// unchanged.
    pub(crate) fn new(settings: &Settings, previous: Option<Self>) -> Result<Self, RequestError> {
        let scene = Arc::new(Scene::from_json(&settings.scene)?);
        let sensor = match &settings.sensor {
            SensorChoice::Preset(name) => Sensor::preset(name)?,
            SensorChoice::Data(data) => (**data).clone(),
        };
        sensor.check()?;
        let air = air(&settings.air)?;
        let options = settings.options;
        let mut setup = Self { scene, sensor, air, options, simulators: BTreeMap::new() };
        if let Some(previous) = previous
            && (&previous.sensor, previous.air, previous.options)
                == (&setup.sensor, setup.air, setup.options)
        {
            for (name, simulator) in previous.simulators {
                let simulator = simulator.in_scene(Arc::clone(&setup.scene))?;
                setup.simulators.insert(name, Arc::new(simulator));
            }
        }
        // Invalid sensors and options are reported now, not with the first sweep.
        setup.simulator(EngineKind::Paths)?;
        Ok(setup)
    }

    /// Simulator of an engine in the scene without the body of the robot.
    pub(crate) fn simulator(&mut self, engine: EngineKind) -> Result<Arc<Simulator>, RequestError> {
        match self.simulators.entry(engine.name()) {
            Entry::Occupied(entry) => Ok(Arc::clone(entry.get())),
            Entry::Vacant(entry) => {
                let options = OptionKeys { engine, ..self.options }.engine_options();
                let scene = Arc::clone(&self.scene);
                let simulator = Simulator::new(scene, self.sensor.clone(), self.air, options)?;
                Ok(Arc::clone(entry.insert(Arc::new(simulator))))
            }
        }
    }
}

/// Adds the body of the scene's robot at a pose, if the scene has one.
pub(crate) fn with_robot(
    simulator: &Arc<Simulator>,
    robot: &Pose,
) -> Result<Arc<Simulator>, RequestError> {
    if simulator.scene().robot.is_none() {
        return Ok(Arc::clone(simulator));
    }
    let scene = simulator.scene().with_robot_at(robot);
    Ok(Arc::new(simulator.in_scene(Arc::new(scene))?))
}

fn air(choice: &AirChoice) -> Result<Air, RequestError> {
    let air = Air::new(choice.temperature_c, choice.humidity_percent, choice.pressure_kpa)?;
    Ok(match choice.sound_speed_m_s {
        None => air,
        Some(speed) => air.with_sound_speed(speed)?,
    })
}
