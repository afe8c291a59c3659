//! What a model is made of, and the simulators made from it.

use std::sync::Arc;

use pyo3::prelude::*;
use sonard::inverse::World;
use sonard_model::{
    acoustics,
    geometry::Pose,
    model::{EngineOptions, ModelError, Options, Simulator},
    scene as model_scene,
};

use super::Model;
use crate::{air::Air, arrays, error, pool::OfProcess, scene::Scene, sensor::Sensor};

/// What a simulator is made of.
pub(super) struct Parts<'a> {
    pub(super) scene: &'a Arc<model_scene::Scene>,
    pub(super) sensor: &'a acoustics::Sensor,
    pub(super) air: acoustics::Air,
    pub(super) options: Options,
}

impl Parts<'_> {
    pub(super) fn simulator(&self) -> Result<Simulator, ModelError> {
        Simulator::new(self.scene.clone(), self.sensor.clone(), self.air, self.options)
    }

    /// With the robot's body at a pose.
    pub(super) fn simulator_at(&self, pose: &Pose) -> Result<Simulator, ModelError> {
        let scene = Arc::new(self.scene.with_robot_at(pose));
        Simulator::new(scene, self.sensor.clone(), self.air, self.options)
    }
}

impl Model {
    pub(crate) fn of(
        py: Python<'_>,
        scene: Py<Scene>,
        sensor: Py<Sensor>,
        air: Air,
        mut options: Options,
    ) -> PyResult<Self> {
        if let EngineOptions::Paths(paths) = &mut options.engine {
            // A ranger alone has none.
            paths.without_crosstalk = false;
        }
        let (of, kind) = (&scene.get().scene, &sensor.get().sensor);
        let parts = Parts { scene: of, sensor: kind, air: air.air, options };
        let simulator =
            py.detach(|| parts.simulator()).map_err(|error| error::model(py, &error))?;
        Ok(Self { scene, sensor, air, options, simulator: OfProcess::new(simulator) })
    }

    /// What readings are explained by.
    pub(crate) fn world(&self) -> World {
        let Parts { scene, sensor, air, options } = self.parts();
        World::new(scene.clone(), sensor.clone(), air, options)
    }

    pub(super) fn parts(&self) -> Parts<'_> {
        Parts {
            scene: &self.scene.get().scene,
            sensor: &self.sensor.get().sensor,
            air: self.air.air,
            options: self.options,
        }
    }

    /// The simulator of the scene without a robot's body.
    pub(super) fn simulator(&self, py: Python<'_>) -> PyResult<Arc<Simulator>> {
        let made = self.simulator.get(py, || self.parts().simulator());
        made.map_err(|error| error::model(py, &error))
    }

    /// The simulator for a pose.
    pub(super) fn simulator_at(&self, py: Python<'_>, pose: &Pose) -> PyResult<Arc<Simulator>> {
        if self.parts().scene.robot.is_none() {
            return self.simulator(py);
        }
        let made = py.detach(|| self.parts().simulator_at(pose));
        made.map(Arc::new).map_err(|error| error::model(py, &error))
    }

    /// The one pose that is given, if a ranger can stand there.
    pub(super) fn checked(&self, given: &Bound<'_, PyAny>) -> PyResult<Pose> {
        let pose = arrays::one_pose(given)?;
        let checked = self.parts().scene.check_pose(&pose);
        checked.map_err(|error| error::pose(given.py(), &[], &error))?;
        Ok(pose)
    }
}
