//! Predictions for a single pose.

use pyo3::{exceptions::PyValueError, prelude::*};
use sonard_model::model::paths as model_paths;

use super::{Model, predict};
use crate::{
    error,
    path::{self, PathResult},
    trace::TraceResult,
};

pub(super) fn reading<'py>(
    model: &Model,
    given: &Bound<'py, PyAny>,
    azimuth_deg: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let py = given.py();
    let pose = model.checked(given)?;
    let direction_rad = predict::direction_rad(&pose, azimuth_deg)?;
    let simulator = model.simulator_at(py, &pose)?;
    let predicted = py
        .detach(|| simulator.at(pose.position()).ping(direction_rad))
        .map_err(|error| error::too_costly(py, &error))?;
    path::reading(py, simulator.scene(), &predicted, None)
}

pub(super) fn paths<'py>(
    model: &Model,
    given: &Bound<'py, PyAny>,
    min_amplitude: Option<f64>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let py = given.py();
    if let Some(amplitude) = min_amplitude.filter(|it| !(1e-6..=1.0).contains(it)) {
        return Err(PyValueError::new_err(format!(
            "min_amplitude is {amplitude}: it must be from 0.000001 to 1"
        )));
    }
    let pose = model.checked(given)?;
    let simulator = model.simulator_at(py, &pose)?;
    let found = py.detach(|| {
        let settings = simulator.path_settings().listing(min_amplitude);
        let paths = model_paths::Paths::new(simulator.scene(), settings);
        paths.visit_between(pose.position(), pose.position(), |echoes| {
            echoes.map(|echo| PathResult::from_echo(simulator.scene(), &echo)).collect::<Vec<_>>()
        })
    });
    let found = found.map_err(|error| error::too_costly(py, &error))?;
    found.into_iter().map(|path| path.into_python(py)).collect()
}

pub(super) fn trace<'py>(
    model: &Model,
    given: &Bound<'py, PyAny>,
    azimuth_deg: f64,
    max_range_m: Option<f64>,
    step_us: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let py = given.py();
    let pose = model.checked(given)?;
    let direction_rad = predict::direction_rad(&pose, azimuth_deg)?;
    let simulator = model.simulator_at(py, &pose)?;
    let max_range_m = max_range_m.unwrap_or(simulator.receiver().max_range_m);
    for (name, value, [min, max]) in
        [("max_range_m", max_range_m, [0.05, 100.0]), ("step_us", step_us, [1.0, 1000.0])]
    {
        if !(min..=max).contains(&value) {
            let message = format!("{name} is {value}: it must be from {min} to {max}");
            return Err(PyValueError::new_err(message));
        }
    }
    let trace = py.detach(|| {
        let point = simulator.at(pose.position());
        TraceResult::compute(simulator.scene(), &point, direction_rad, max_range_m, step_us)
    });
    trace.map_err(|error| error::too_costly(py, &error))?.into_python(py)
}
