//! Batches of readings on many threads.

use numpy::PyArray1;
use pyo3::{exceptions::PyMemoryError, prelude::*, types::PyTuple};
use rayon::prelude::*;
use sonard_model::model::ModelError;

use crate::{arrays::READING_WORDS, error, pool::pool};

/// Number of poses that a thread predicts between checks for signals.
const POSES_PER_BATCH: usize = 64;

/// Computes a table with `each` readings at each of the poses `poses`; `fire` fills the row of a
/// pose. The interpreter lock is released during the computation, and an interrupt ends it.
pub(crate) fn table<S: Sync>(
    py: Python<'_>,
    poses: &[S],
    each: usize,
    threads: Option<usize>,
    fire: impl Fn(&S, &mut [f64]) -> Result<(), ModelError> + Sync,
) -> PyResult<Vec<f64>> {
    let pool = pool(py, threads)?;
    let words = READING_WORDS * each;
    let mut table = zeroed(words, poses.len())?;
    if words == 0 {
        return Ok(table);
    }
    let at_once = POSES_PER_BATCH * pool.current_num_threads();
    for (poses, rows) in poses.chunks(at_once).zip(table.chunks_mut(at_once * words)) {
        let done = py.detach(|| {
            let pairs = poses.par_iter().zip(rows.par_chunks_mut(words));
            pool.install(|| pairs.try_for_each(|(pose, row)| fire(pose, row)))
        });
        done.map_err(|error| error::model(py, &error))?;
        py.check_signals()?;
    }
    Ok(table)
}

/// Converts such a table to an array of readings.
pub(crate) fn shaped<'py>(
    py: Python<'py>,
    table: Vec<f64>,
    dtype: Bound<'py, PyAny>,
    shape: Vec<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let readings = PyArray1::from_vec(py, table).call_method1("view", (dtype,))?;
    readings.call_method1("reshape", (PyTuple::new(py, shape)?,))
}

fn zeroed(words: usize, poses: usize) -> PyResult<Vec<f64>> {
    let mut table = Vec::new();
    let reserved = words.checked_mul(poses).map(|length| (length, table.try_reserve_exact(length)));
    match reserved {
        Some((length, Ok(()))) => {
            table.resize(length, 0.0);
            Ok(table)
        }
        _ => Err(PyMemoryError::new_err(format!(
            "not enough memory for {poses} poses with {} readings each: pass fewer poses per call",
            words / READING_WORDS
        ))),
    }
}
