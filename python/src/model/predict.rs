//! Batch prediction for a ranger.

use std::{sync::Arc, time::Instant};

use pyo3::{exceptions::PyValueError, prelude::*, types::PyTuple};
use sonard_model::{
    geometry::Pose,
    model::{ModelError, Simulator},
    scan_plan::ScanPlan,
};

use super::{Model, parts::Parts};
use crate::{
    arrays::{self, PoseArray, READING_WORDS},
    error, firing,
    pool::pool,
};

/// Largest magnitude of an azimuth, degrees.
const MAX_AZIMUTH_DEG: f64 = 1e6;

pub(super) fn predict<'py>(
    model: &Model,
    py: Python<'py>,
    poses: &Bound<'py, PyAny>,
    azimuths_deg: Option<&Bound<'py, PyAny>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let poses = PoseArray::from_python(poses)?;
    let azimuths_deg = azimuths_deg.map_or_else(|| Ok(full_turn()), checked_azimuths)?;
    let simulators = PoseSimulators::checked(model, py, &poses)?;
    let fire = |pose: &Pose, row: &mut [f64]| simulators.fire(pose, &azimuths_deg, row);
    let table = firing::table(py, &poses.list, azimuths_deg.len(), threads, fire)?;
    let mut shape = poses.shape;
    shape.push(azimuths_deg.len());
    firing::shaped(py, table, arrays::reading_dtype(py)?, shape)
}

/// Predicts one reading per pose.
pub(super) fn fire<'py>(
    model: &Model,
    py: Python<'py>,
    poses: &Bound<'py, PyAny>,
    azimuths_deg: &Bound<'py, PyAny>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let poses = PoseArray::from_python(poses)?;
    let shape = PyTuple::new(py, &poses.shape)?;
    let broadcast = py.import("numpy")?.call_method1("broadcast_to", (azimuths_deg, shape))?;
    let azimuths_deg = checked_azimuths(&broadcast.call_method1("reshape", (-1,))?)?;
    let simulators = PoseSimulators::checked(model, py, &poses)?;
    let firings: Vec<(Pose, f64)> = poses.list.iter().copied().zip(azimuths_deg).collect();
    let fire = |(pose, azimuth_deg): &(Pose, f64), row: &mut [f64]| {
        simulators.fire(pose, &[*azimuth_deg], row)
    };
    let table = firing::table(py, &firings, 1, threads, fire)?;
    firing::shaped(py, table, arrays::reading_dtype(py)?, poses.shape)
}

/// Simulators for poses at which the ranger can be placed.
struct PoseSimulators<'a> {
    parts: Parts<'a>,
    shared: Arc<Simulator>,
}

impl<'a> PoseSimulators<'a> {
    fn checked(model: &'a Model, py: Python<'_>, poses: &PoseArray) -> PyResult<Self> {
        let parts = model.parts();
        let checked = py.detach(|| parts.scene.check_poses(&poses.list));
        checked.map_err(|(at, error)| error::pose(py, &poses.index(at), &error))?;
        Ok(Self { parts, shared: model.simulator(py)? })
    }

    fn fire(&self, pose: &Pose, azimuths_deg: &[f64], row: &mut [f64]) -> Result<(), ModelError> {
        match self.parts.scene.robot {
            None => fire_all(&self.shared, pose, azimuths_deg, row),
            Some(_) => fire_all(&self.parts.simulator_at(pose)?, pose, azimuths_deg, row),
        }
    }
}

/// Azimuths of a default scan.
pub(crate) fn full_turn() -> Vec<f64> {
    let plan = ScanPlan::default();
    (0..plan.stops()).map(|stop| plan.azimuth_deg(stop)).collect()
}

fn checked_azimuths(given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let azimuths_deg = arrays::list(given, "azimuths_deg")?;
    match azimuths_deg.iter().position(|azimuth| !is_azimuth(*azimuth)) {
        None => Ok(azimuths_deg),
        Some(at) => Err(PyValueError::new_err(format!(
            "azimuths_deg[{at}] is {}: it must be a finite number of degrees",
            azimuths_deg[at]
        ))),
    }
}

/// Direction of an azimuth in the world at a pose, radians.
pub(super) fn direction_rad(pose: &Pose, azimuth_deg: f64) -> PyResult<f64> {
    if is_azimuth(azimuth_deg) {
        return Ok(pose.direction_rad(azimuth_deg));
    }
    let message = format!("azimuth_deg is {azimuth_deg}: it must be a finite number of degrees");
    Err(PyValueError::new_err(message))
}

fn is_azimuth(azimuth_deg: f64) -> bool {
    azimuth_deg.abs() <= MAX_AZIMUTH_DEG
}

fn fire_all(
    simulator: &Simulator,
    pose: &Pose,
    azimuths_deg: &[f64],
    row: &mut [f64],
) -> Result<(), ModelError> {
    let point = simulator.at(pose.position());
    for (azimuth_deg, words) in azimuths_deg.iter().zip(row.chunks_exact_mut(READING_WORDS)) {
        let prediction = point.ping(pose.direction_rad(*azimuth_deg))?;
        words.copy_from_slice(&arrays::encode_reading(&prediction));
    }
    Ok(())
}

/// Measures the time of the library's `predict_many` for default scans at some poses, in seconds,
/// as a reference for `benches/predict.py`.
#[pyfunction]
#[pyo3(name = "_time_predict_many", signature = (model, poses, threads = None))]
pub(crate) fn seconds_of_predict_many(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    poses: &Bound<'_, PyAny>,
    threads: Option<usize>,
) -> PyResult<f64> {
    let poses = PoseArray::from_python(poses)?;
    let simulator = model.get().simulator(py)?;
    let pool = pool(py, threads)?;
    let took = py.detach(|| {
        let began = Instant::now();
        let readings =
            pool.install(|| simulator.predict_many(&poses.list, &ScanPlan::default()))?;
        std::hint::black_box(&readings);
        Ok(began.elapsed().as_secs_f64())
    });
    took.map_err(|error| error::too_costly(py, &error))
}
