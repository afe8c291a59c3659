//! Components of a model, and the simulators built from them.

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
use crate::{air::Air, arrays, error, pool::PerProcess, scene::Scene, sensor::Sensor};

/// Components of a simulator.
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

    /// Builds the simulator with the robot's body at a pose.
    pub(super) fn simulator_at(&self, pose: &Pose) -> Result<Simulator, ModelError> {
        let scene = Arc::new(self.scene.with_robot_at(pose));
        Simulator::new(scene, self.sensor.clone(), self.air, self.options)
    }
}

impl Model {
    pub(crate) fn build(
        py: Python<'_>,
        scene: Py<Scene>,
        sensor: Py<Sensor>,
        air: Air,
        mut options: Options,
    ) -> PyResult<Self> {
        if let EngineOptions::Paths(paths) = &mut options.engine {
            // A single ranger has no crosstalk.
            paths.without_crosstalk = false;
        }
        let (plain, kind) = (&scene.get().scene, &sensor.get().sensor);
        let parts = Parts { scene: plain, sensor: kind, air: air.air, options };
        let simulator =
            py.detach(|| parts.simulator()).map_err(|error| error::model(py, &error))?;
        Ok(Self { scene, sensor, air, options, simulator: PerProcess::new(simulator) })
    }

    /// Returns the input of a fit.
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

    /// Returns the simulator of the scene without a robot's body.
    pub(super) fn simulator(&self, py: Python<'_>) -> PyResult<Arc<Simulator>> {
        let simulator = self.simulator.get(py, || self.parts().simulator());
        simulator.map_err(|error| error::model(py, &error))
    }

    /// Returns the simulator for a pose.
    pub(super) fn simulator_at(&self, py: Python<'_>, pose: &Pose) -> PyResult<Arc<Simulator>> {
        if self.parts().scene.robot.is_none() {
            return self.simulator(py);
        }
        let simulator = py.detach(|| self.parts().simulator_at(pose));
        simulator.map(Arc::new).map_err(|error| error::model(py, &error))
    }

    /// Converts a single pose and checks that a ranger can be placed there.
    pub(super) fn checked(&self, given: &Bound<'_, PyAny>) -> PyResult<Pose> {
        let pose = arrays::one_pose(given)?;
        let checked = self.parts().scene.check_pose(&pose);
        checked.map_err(|error| error::pose(given.py(), &[], &error))?;
        Ok(pose)
    }
}
