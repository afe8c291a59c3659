//! What scans say beside predictions, and of features.

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
    error::{LogError, refuse},
    json,
    log::{Scan, scans_of},
    pool::pool,
};

/// Sets the readings of scans beside the predictions that the log holds.
///
/// Parameters
/// ----------
/// scans : Log, Scan or sequence of them
///
/// Returns
/// -------
/// dict
///     As ``sonard compare --json`` prints it: counts of beams by verdict, how many pairs of echoes agree, residuals
///     in metres, and ``explanations``, what would explain the readings better.
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

/// Tells planes, corners and edges apart in scans of one ranger on a stepper, after Bozma and Kuc.
///
/// Parameters
/// ----------
/// scans : Log, Scan or sequence of them
///     From one place or more; scans that can't be used are left out with a warning.
/// min_confidence : float
///     Nothing less probable than this is named, 0 to 1.
/// depth_tolerance_m : float
///     How far a reading may be from its arc's mean, metres.
///
/// Returns
/// -------
/// list of dict
///     As ``sonard interpret --json`` prints them: ``kind``, ``x_m``, ``y_m``, ``confidence``, ``reason``, ...
#[pyfunction]
#[pyo3(name = "interpret", signature = (scans, *, min_confidence = 0.9, depth_tolerance_m = 0.01))]
pub(crate) fn find_features<'py>(
    py: Python<'py>,
    scans: &Bound<'py, PyAny>,
    min_confidence: f64,
    depth_tolerance_m: f64,
) -> PyResult<Bound<'py, PyAny>> {
    for (name, value, most) in
        [("min_confidence", min_confidence, 1.0), ("depth_tolerance_m", depth_tolerance_m, 1e3)]
    {
        if !(0.0..=most).contains(&value) {
            let message = format!("{name} is {value}: it must be from 0 to {most}");
            return Err(PyValueError::new_err(message));
        }
    }
    let scans = scans_of(scans)?;
    let mut sweeps: Vec<(Uuid, interpret::Sweep)> = Vec::new();
    let mut first: Option<&Scan> = None;
    for scan in &scans {
        let (scan, view) = (scan.get(), scan.get().view());
        if view.is_of_array() {
            let help = "arcs need one ranger that turns";
            return Err(refuse::<LogError>(
                py,
                &format!("scan {} is of an array", view.scan),
                help,
            ));
        }
        match interpret::Sweep::of(view) {
            Ok(sweep) => sweeps.push((view.scan, sweep)),
            Err(error) => {
                warn(py, &format!("scan {} is left out: {error}", view.scan))?;
                continue;
            }
        }
        let known = *first.get_or_insert(scan);
        if known.session_of(py)?.sensor != scan.session_of(py)?.sensor {
            let help = "interpret the scans of each sensor by themselves";
            let message = "the scans are of different sensors, whose arcs differ";
            return Err(refuse::<LogError>(py, message, help));
        }
    }
    let Some(first) = first else {
        let message = "there is no scan with its session to interpret";
        return Err(refuse::<LogError>(py, message, ""));
    };
    let extents = Extents::of_session(first.session_of(py)?)
        .map_err(|error| refuse::<LogError>(py, &format!("session: {error}"), ""))?;
    let settings =
        interpret::Settings { min_confidence, depth_tolerance_m, ..interpret::Settings::default() };
    let pool = pool(py, None)?;
    let features =
        py.detach(|| pool.install(|| interpret::interpret(&sweeps, &extents, &settings)));
    json::to_python(py, &features)
}

/// Warns as of whoever called.
pub(crate) fn warn(py: Python<'_>, message: &str) -> PyResult<()> {
    let words = std::ffi::CString::new(message).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &words, 1)
}
