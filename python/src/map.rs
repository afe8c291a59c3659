//! Occupancy grids from scans.

use pyo3::{exceptions::PyValueError, prelude::*};
use sonard::{
    interpret::{
        Extents, Sweep,
        grid::Grid,
        mapping::{MapSettings, Mapper},
    },
    scan::Session,
};
use sonard_model::geometry::DVec2;

use crate::{
    arrays,
    error::{LogError, SonardError, new_error},
    log::{Scan, scans_of},
    path::result,
    sense::warn,
};

/// Computes an occupancy grid from scans, each at its logged pose.
///
/// Parameters
/// ----------
/// scans : Log, Scan or sequence of them
///     Scans of a single sensor; unusable scans are skipped with a warning.
/// resolution_m : float
///     Side of a cell, metres.
/// region : tuple of float, optional
///     Region of the map, x0, y0, x1, y1 in metres. Defaults to the region observed by the scans.
/// max_range_m : float, optional
///     Ranges beyond this count as no echo, metres. Defaults to the range of the sensor, at most 5.
/// feature_prediction : bool
///     Reduce the weight of readings that contradict predicted walls.
/// extend_m : float
///     Length by which walls are extended beyond their observed part, metres.
/// min_reading_confidence : float
///     Minimum confidence of the readings used; 0.5 is full confidence.
///
/// Returns
/// -------
/// Map
///     Same result as ``sonard map`` for these scans.
#[pyfunction]
#[pyo3(name = "map", signature = (scans, *, resolution_m = 0.05, region = None, max_range_m = None, feature_prediction = true, extend_m = 2.0, min_reading_confidence = 0.48))]
#[expect(clippy::too_many_arguments, reason = "they are keywords where they are used")]
pub(crate) fn make_map<'py>(
    py: Python<'py>,
    scans: &Bound<'py, PyAny>,
    resolution_m: f64,
    region: Option<[f64; 4]>,
    max_range_m: Option<f64>,
    feature_prediction: bool,
    extend_m: f64,
    min_reading_confidence: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let lengths_m = [Some(resolution_m), max_range_m, Some(extend_m), Some(min_reading_confidence)];
    checked(lengths_m)?;
    let mapping = MapSettings {
        resolution_m,
        region: region.map(|[x0, y0, x1, y1]| [DVec2::new(x0, y0), DVec2::new(x1, y1)]),
        range_limit_m: max_range_m,
        extend_m,
        min_confidence: min_reading_confidence,
        predicts_features: feature_prediction,
        ..MapSettings::default()
    };
    let scans = scans_of(scans)?;
    let (sweeps, session) = sweeps(py, &scans)?;
    let extents = Extents::from_session(session)
        .map_err(|error| new_error::<LogError>(py, &format!("session: {error}"), ""))?;
    let shape = mapping
        .shape(&sweeps, mapping.max_range_m(&extents))
        .map_err(|error| new_error::<SonardError>(py, &error.to_string(), ""))?;
    let is_array = session.array.is_some();
    let grid = py.detach(|| {
        let mut mapper = Mapper::new(&mapping, Grid::new(shape), extents, is_array, sweeps.len());
        sweeps.iter().for_each(|sweep| drop(mapper.add(sweep)));
        mapper.finish()
    });
    let occupancy =
        arrays::shaped(py, grid.probabilities().collect(), &[shape.height, shape.width])?;
    let origin_m = (shape.origin.x, shape.origin.y);
    result(py, "Map", (occupancy, origin_m, shape.resolution_m))
}

/// Rejects invalid lengths and confidences; some may be 0.
fn checked(values: [Option<f64>; 4]) -> PyResult<()> {
    let above_0 = f64::MIN_POSITIVE;
    let names = [
        ("resolution_m", above_0),
        ("max_range_m", above_0),
        ("extend_m", 0.0),
        ("min_reading_confidence", 0.0),
    ];
    for ((name, min), value) in names.into_iter().zip(values) {
        if let Some(value) = value.filter(|value| !(min..=1e6).contains(value)) {
            return Err(PyValueError::new_err(format!(
                "{name} is {value}: it must be greater than 0"
            )));
        }
    }
    Ok(())
}

/// Extracts the usable sweeps of the scans, and the session of the first.
fn sweeps<'a>(py: Python<'_>, scans: &'a [Py<Scan>]) -> PyResult<(Vec<Sweep>, &'a Session)> {
    let (mut sweeps, mut first): (Vec<Sweep>, Option<&Scan>) = (Vec::new(), None);
    for scan in scans {
        let view = scan.get().view();
        match Sweep::from_scan(view) {
            Ok(sweep) => sweeps.push(sweep),
            Err(error) => {
                warn(py, &format!("scan {} skipped: {error}", view.scan))?;
                continue;
            }
        }
        first.get_or_insert(scan.get());
    }
    let none = || new_error::<LogError>(py, "no scan with session and pose to map", "");
    Ok((sweeps, first.ok_or_else(none)?.session_of(py)?))
}
