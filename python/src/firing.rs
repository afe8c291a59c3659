//! Many readings at once, on many threads.

use numpy::PyArray1;
use pyo3::{exceptions::PyMemoryError, prelude::*, types::PyTuple};
use rayon::prelude::*;
use sonard_model::model::ModelError;

use crate::{arrays::READING_WORDS, error, pool::pool};

/// Stands that a thread predicts before signals are looked at.
const STANDS_AT_ONCE: usize = 64;

/// The words of so many readings at each stand, one stand after the other; `fire` fills the row of one. The
/// interpreter's lock is free meanwhile, and an interrupt ends it.
pub(crate) fn table<S: Sync>(
    py: Python<'_>,
    stands: &[S],
    each: usize,
    threads: Option<usize>,
    fire: impl Fn(&S, &mut [f64]) -> Result<(), ModelError> + Sync,
) -> PyResult<Vec<f64>> {
    let pool = pool(py, threads)?;
    let words = READING_WORDS * each;
    let mut table = empty(words, stands.len())?;
    if words == 0 {
        return Ok(table);
    }
    let at_once = STANDS_AT_ONCE * pool.current_num_threads();
    for (stands, rows) in stands.chunks(at_once).zip(table.chunks_mut(at_once * words)) {
        let done = py.detach(|| {
            let pairs = stands.par_iter().zip(rows.par_chunks_mut(words));
            pool.install(|| pairs.try_for_each(|(stand, row)| fire(stand, row)))
        });
        done.map_err(|error| error::model(py, &error))?;
        py.check_signals()?;
    }
    Ok(table)
}

/// Such a table as an array of readings.
pub(crate) fn shaped<'py>(
    py: Python<'py>,
    table: Vec<f64>,
    dtype: Bound<'py, PyAny>,
    shape: Vec<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let readings = PyArray1::from_vec(py, table).call_method1("view", (dtype,))?;
    readings.call_method1("reshape", (PyTuple::new(py, shape)?,))
}

fn empty(words: usize, poses: usize) -> PyResult<Vec<f64>> {
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
