//! Readings of many poses.

use std::time::Instant;

use numpy::PyArray1;
use pyo3::{
    exceptions::{PyMemoryError, PyValueError},
    prelude::*,
    types::PyTuple,
};
use rayon::prelude::*;
use sonard_model::{
    geometry::Pose,
    model::{ModelError, Simulator},
    plan::ScanPlan,
};

use super::Model;
use crate::{
    arrays::{self, Poses, READING_WORDS},
    error,
    pool::pool,
};

/// Poses that a thread predicts before signals are looked at.
const POSES_AT_ONCE: usize = 64;

/// Largest magnitude of an azimuth, degrees.
const MOST_AZIMUTH_DEG: f64 = 1e6;

pub(super) fn predict<'py>(
    model: &Model,
    py: Python<'py>,
    poses: &Bound<'py, PyAny>,
    azimuths_deg: Option<&Bound<'py, PyAny>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let poses = Poses::of(poses)?;
    let azimuths_deg = azimuths_deg.map_or_else(|| Ok(full_turn()), checked_azimuths)?;
    let parts = model.parts();
    let pool = pool(py, threads)?;
    let checked = py.detach(|| parts.scene.check_poses(&poses.list));
    checked.map_err(|(at, error)| error::pose(py, &poses.index(at), &error))?;

    let words = READING_WORDS * azimuths_deg.len();
    let mut table = empty_table(words, poses.list.len())?;
    let shared = model.simulator(py)?;
    let fire = |pose: &Pose, row: &mut [f64]| -> Result<(), ModelError> {
        match parts.scene.robot {
            None => fire_all(&shared, pose, &azimuths_deg, row),
            Some(_) => fire_all(&parts.simulator_at(pose)?, pose, &azimuths_deg, row),
        }
    };
    let at_once = POSES_AT_ONCE * pool.current_num_threads();
    if words > 0 {
        for (poses, rows) in poses.list.chunks(at_once).zip(table.chunks_mut(at_once * words)) {
            let done = py.detach(|| {
                let pairs = poses.par_iter().zip(rows.par_chunks_mut(words));
                pool.install(|| pairs.try_for_each(|(pose, row)| fire(pose, row)))
            });
            done.map_err(|error| error::model(py, &error))?;
            py.check_signals()?;
        }
    }
    let mut shape = poses.shape;
    shape.push(azimuths_deg.len());
    let readings = PyArray1::from_vec(py, table);
    let readings = readings.call_method1("view", (arrays::reading_dtype(py)?,))?;
    readings.call_method1("reshape", (PyTuple::new(py, shape)?,))
}

/// The azimuths of a scan that was asked nothing else.
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

/// World direction of an azimuth at a pose, radians.
pub(super) fn direction_rad(pose: &Pose, azimuth_deg: f64) -> PyResult<f64> {
    if is_azimuth(azimuth_deg) {
        return Ok(pose.direction_rad(azimuth_deg));
    }
    let message = format!("azimuth_deg is {azimuth_deg}: it must be a finite number of degrees");
    Err(PyValueError::new_err(message))
}

fn is_azimuth(azimuth_deg: f64) -> bool {
    azimuth_deg.abs() <= MOST_AZIMUTH_DEG
}

fn empty_table(words: usize, poses: usize) -> PyResult<Vec<f64>> {
    let mut table = Vec::new();
    let reserved = words.checked_mul(poses).map(|length| (length, table.try_reserve_exact(length)));
    match reserved {
        Some((length, Ok(()))) => {
            table.resize(length, 0.0);
            Ok(table)
        }
        _ => Err(PyMemoryError::new_err(format!(
            "no memory for {poses} poses of {} readings: give fewer poses at once",
            words / READING_WORDS
        ))),
    }
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
        words.copy_from_slice(&arrays::words_of(&prediction));
    }
    Ok(())
}

/// Seconds that the library's `predict_many` takes for full turns at some poses, on threads as above: what
/// `benches/predict.py` holds `predict` against.
#[pyfunction]
#[pyo3(name = "_seconds_of_predict_many", signature = (model, poses, threads = None))]
pub(crate) fn seconds_of_predict_many(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    poses: &Bound<'_, PyAny>,
    threads: Option<usize>,
) -> PyResult<f64> {
    let poses = Poses::of(poses)?;
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
