//! Comparison of scans with predictions, and feature extraction.

use pyo3::{
    exceptions::{PyUserWarning, PyValueError},
    prelude::*,
};
use sonard::{
    compare::{Comparer, Comparison},
    interpret::{self, Extents},
};
use uuid::Uuid;

use crate::{
    error::{LogError, new_error},
    json,
    log::{Scan, scans_of},
    pool::pool,
};

/// Compares the readings of scans with the logged predictions.
///
/// Parameters
/// ----------
/// scans : Log, Scan or sequence of them
///
/// Returns
/// -------
/// dict
///     As printed by ``sonard compare --json``: counts of beams by class, number of agreeing pairs
///     of echoes, residuals in metres, and ``explanations``, changes of the model that would fit
///     the readings better.
#[pyfunction]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    scans: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let scans = scans_of(scans)?;
    let views: Vec<_> = scans.iter().map(|scan| scan.get().view()).collect();
    let pool = pool(py, None)?;
    let compared: Comparison = py.detach(|| {
        pool.install(|| {
            let mut comparer = Comparer::default();
            views.into_iter().for_each(|view| drop(comparer.add(view)));
            comparer.finish()
        })
    });
    json::to_python(py, &compared)
}

/// Classifies planes, corners and edges in scans of a ranger on a stepper, after Bozma and Kuc.
///
/// Parameters
/// ----------
/// scans : Log, Scan or sequence of them
///     Scans from one or more positions; unusable scans are skipped with a warning.
/// min_confidence : float
///     Minimum probability of a reported feature, 0 to 1.
/// depth_tolerance_m : float
///     Tolerance of a reading from the mean of its arc, metres.
///
/// Returns
/// -------
/// list of dict
///     As printed by ``sonard interpret --json``: ``kind``, ``x_m``, ``y_m``, ``confidence``,
///     ``reason``, ...
#[pyfunction]
#[pyo3(name = "interpret", signature = (scans, *, min_confidence = 0.9, depth_tolerance_m = 0.01))]
pub(crate) fn find_features<'py>(
    py: Python<'py>,
    scans: &Bound<'py, PyAny>,
    min_confidence: f64,
    depth_tolerance_m: f64,
) -> PyResult<Bound<'py, PyAny>> {
    for (name, value, max) in
        [("min_confidence", min_confidence, 1.0), ("depth_tolerance_m", depth_tolerance_m, 1e3)]
    {
        if !(0.0..=max).contains(&value) {
            let message = format!("{name} is {value}: it must be from 0 to {max}");
            return Err(PyValueError::new_err(message));
        }
    }
    let scans = scans_of(scans)?;
    let mut sweeps: Vec<(Uuid, interpret::Sweep)> = Vec::new();
    let mut first: Option<&Scan> = None;
    for scan in &scans {
        let (scan, view) = (scan.get(), scan.get().view());
        if view.is_array_scan() {
            let help = "arcs require a single rotating ranger";
            return Err(new_error::<LogError>(
                py,
                &format!("scan {} is from an array", view.scan),
                help,
            ));
        }
        match interpret::Sweep::from_scan(view) {
            Ok(sweep) => sweeps.push((view.scan, sweep)),
            Err(error) => {
                warn(py, &format!("scan {} skipped: {error}", view.scan))?;
                continue;
            }
        }
        let known = *first.get_or_insert(scan);
        if known.session_of(py)?.sensor != scan.session_of(py)?.sensor {
            let help = "interpret the scans of each sensor separately";
            let message = "the scans have different sensors, whose arcs differ";
            return Err(new_error::<LogError>(py, message, help));
        }
    }
    let Some(first) = first else {
        let message = "no scan with session to interpret";
        return Err(new_error::<LogError>(py, message, ""));
    };
    let extents = Extents::from_session(first.session_of(py)?)
        .map_err(|error| new_error::<LogError>(py, &format!("session: {error}"), ""))?;
    let settings = interpret::InterpretSettings {
        min_confidence,
        depth_tolerance_m,
        ..interpret::InterpretSettings::default()
    };
    let pool = pool(py, None)?;
    let features =
        py.detach(|| pool.install(|| interpret::interpret(&sweeps, &extents, &settings)));
    json::to_python(py, &features)
}

/// Issues a warning attributed to the caller.
pub(crate) fn warn(py: Python<'_>, message: &str) -> PyResult<()> {
    let text = std::ffi::CString::new(message).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)
}
