//! What scans say: comparison, features, and where they were taken.

use pyo3::{
    exceptions::{PyUserWarning, PyValueError},
    prelude::*,
};
use sonard::{
    compare::{Comparer, Comparison},
    interpret::{
        self, Extents,
        grid::Grid,
        mapping::{Mapper, Mapping},
    },
    inverse,
};
use sonard_model::{
    geometry::{DVec2, Pose},
    reading::PingStatus,
};
use uuid::Uuid;

use crate::{
    arrays,
    error::{LogError, SonardError, refuse},
    json,
    log::{Scan, scans_of},
    model::Model,
    path::result,
    pool::pool,
    readings::Heard,
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

/// Makes an occupancy grid of scans, each taken at its pose.
///
/// Parameters
/// ----------
/// scans : Log, Scan or sequence of them
///     Of one sensor; scans that can't be used are left out with a warning.
/// resolution_m : float
///     Side of a cell, metres.
/// region : tuple of float, optional
///     What to map, x0, y0, x1, y1 in metres; without it around what was seen.
/// silent_beyond_m : float, optional
///     Ranges beyond this are taken for silence, metres; without it the sensor's, at most 5.
/// feature_prediction : bool
///     Whether readings that predicted walls contradict count less.
/// extend_m : float
///     How far walls are taken to go on beyond what was seen of them, metres.
/// least_confidence : float
///     Readings of less confidence are left out; 0.5 is full confidence.
///
/// Returns
/// -------
/// Map
///     What ``sonard map`` makes of the same scans.
#[pyfunction]
#[pyo3(name = "map", signature = (scans, *, resolution_m = 0.05, region = None, silent_beyond_m = None, feature_prediction = true, extend_m = 2.0, least_confidence = 0.48))]
#[expect(clippy::too_many_arguments, reason = "they are keywords where they are used")]
pub(crate) fn make_map<'py>(
    py: Python<'py>,
    scans: &Bound<'py, PyAny>,
    resolution_m: f64,
    region: Option<[f64; 4]>,
    silent_beyond_m: Option<f64>,
    feature_prediction: bool,
    extend_m: f64,
    least_confidence: f64,
) -> PyResult<Bound<'py, PyAny>> {
    for (name, value) in [
        ("resolution_m", Some(resolution_m)),
        ("silent_beyond_m", silent_beyond_m),
        ("extend_m", Some(extend_m)),
        ("least_confidence", Some(least_confidence)),
    ] {
        let least =
            if name.ends_with("_m") && name != "extend_m" { f64::MIN_POSITIVE } else { 0.0 };
        if value.is_some_and(|value| !(least..=1e6).contains(&value)) {
            let value = value.unwrap_or_default();
            return Err(PyValueError::new_err(format!(
                "{name} is {value}: it must be greater than 0"
            )));
        }
    }
    let scans = scans_of(scans)?;
    let (mut sweeps, mut first): (Vec<interpret::Sweep>, Option<&Scan>) = (Vec::new(), None);
    for scan in &scans {
        let view = scan.get().view();
        match interpret::Sweep::of(view) {
            Ok(sweep) => sweeps.push(sweep),
            Err(error) => {
                warn(py, &format!("scan {} is left out: {error}", view.scan))?;
                continue;
            }
        }
        first.get_or_insert(scan.get());
    }
    let Some(first) = first else {
        let message = "there is no scan with its session and pose to map";
        return Err(refuse::<LogError>(py, message, ""));
    };
    let session = first.session_of(py)?;
    let extents = Extents::of_session(session)
        .map_err(|error| refuse::<LogError>(py, &format!("session: {error}"), ""))?;
    let mapping = Mapping {
        resolution_m,
        region: region.map(|[x0, y0, x1, y1]| [DVec2::new(x0, y0), DVec2::new(x1, y1)]),
        silent_beyond_m,
        extend_m,
        least_confidence,
        predicts_features: feature_prediction,
        ..Mapping::default()
    };
    let shape = mapping
        .shape(&sweeps, mapping.max_range_m(&extents))
        .map_err(|error| refuse::<SonardError>(py, &error.to_string(), ""))?;
    let of_array = session.array.is_some();
    let grid = py.detach(|| {
        let mut mapper = Mapper::new(&mapping, Grid::new(shape), extents, of_array, sweeps.len());
        sweeps.iter().for_each(|sweep| drop(mapper.add(sweep)));
        mapper.finish()
    });
    let occupancy =
        arrays::shaped(py, grid.probabilities().collect(), &[shape.height, shape.width])?;
    let origin_m = (shape.origin.x, shape.origin.y);
    result(py, "Map", (occupancy, origin_m, shape.resolution_m))
}

fn warn(py: Python<'_>, message: &str) -> PyResult<()> {
    let words = std::ffi::CString::new(message).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &words, 1)
}

/// Finds where a sweep was taken, without a guess.
///
/// Predicts what would be read on a grid of places when it is made; ``locate`` then looks up and improves what fits.
///
/// Parameters
/// ----------
/// model : Model
///     With the scene to locate in.
/// spacing_m : float
///     Spacing of the grid, metres, 0.01 to 2.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Locator {
    model: Py<Model>,
    world: inverse::World,
    atlas: inverse::Atlas,
    spacing_m: f64,
}

#[pymethods]
impl Locator {
    #[new]
    #[pyo3(signature = (model, spacing_m = 0.1))]
    fn new(py: Python<'_>, model: Py<Model>, spacing_m: f64) -> PyResult<Self> {
        if !(0.01..=2.0).contains(&spacing_m) {
            let message = format!("spacing_m is {spacing_m}: it must be from 0.01 to 2");
            return Err(PyValueError::new_err(message));
        }
        let world = model.get().world();
        let pool = pool(py, None)?;
        let atlas = py.detach(|| pool.install(|| inverse::Atlas::new(&world, spacing_m)));
        let atlas = atlas.map_err(|error| refuse::<SonardError>(py, &error.to_string(), ""))?;
        Ok(Self { model, world, atlas, spacing_m })
    }

    /// The poses that explain a sweep, most probable first.
    ///
    /// Parameters
    /// ----------
    /// readings : Scan or array_like, shape (beams,)
    ///     Of one place: a scan of a log, readings as ``Model.predict`` gives them, or ranges in metres, ``inf`` for a
    ///     silence and ``nan`` for what was not measured.
    /// azimuths_deg : array_like, shape (beams,), optional
    ///     Where they were fired, degrees; without it 400 azimuths from 0 to 359.1. A scan has its own.
    ///
    /// Returns
    /// -------
    /// list of dict
    ///     ``x_m``, ``y_m``, ``heading_deg``, ``probability``, ``sigma_x_m``, ``sigma_y_m``, ``sigma_heading_deg``
    ///     and ``explained``, the share of the readings that the pose explains.
    #[pyo3(signature = (readings, azimuths_deg = None))]
    fn locate<'py>(
        &self,
        py: Python<'py>,
        readings: &Bound<'py, PyAny>,
        azimuths_deg: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let sweep = self.sweep(py, readings, azimuths_deg)?;
        let pool = pool(py, None)?;
        let found = py.detach(|| {
            pool.install(|| {
                let modes = inverse::locate(&self.world, &self.atlas, &sweep)?;
                let doubts = inverse::doubts(&self.world, &self.atlas, &sweep, &modes);
                Ok::<_, inverse::FitError>((modes, doubts))
            })
        });
        let (modes, doubts) =
            found.map_err(|error| refuse::<SonardError>(py, &error.to_string(), ""))?;
        doubts.iter().try_for_each(|doubt| warn(py, &doubt.to_string()))?;
        json::to_python(py, &modes)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let model: String = self.model.bind(py).repr()?.extract()?;
        Ok(format!("<Locator, {} m apart, by {model}>", self.spacing_m))
    }

    fn __getnewargs__(&self, py: Python<'_>) -> (Py<Model>, f64) {
        (self.model.clone_ref(py), self.spacing_m)
    }
}

impl Locator {
    fn sweep(
        &self,
        py: Python<'_>,
        readings: &Bound<'_, PyAny>,
        azimuths_deg: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<inverse::Sweep> {
        if let Ok(scan) = readings.cast::<Scan>() {
            if azimuths_deg.is_some() {
                return Err(PyValueError::new_err("azimuths_deg: a scan has its own"));
            }
            return inverse::Sweep::of(scan.get().view())
                .map_err(|error| refuse::<LogError>(py, &error.to_string(), ""));
        }
        let heard = Heard::of(readings, azimuths_deg)?;
        let us_per_m = 2e6 / self.world.air.sound_speed_m_s();
        let beams: Vec<inverse::Beam> = heard
            .beams
            .into_iter()
            .filter_map(|(azimuth_deg, status, range_m)| {
                let heard = match status {
                    PingStatus::Echo => inverse::Heard::Echo { tof_us: range_m * us_per_m },
                    PingStatus::NoEcho => inverse::Heard::Silence,
                    _ => return None,
                };
                Some(inverse::Beam { azimuth_deg, heard })
            })
            .collect();
        if beams.len() < LEAST_BEAMS {
            return Err(PyValueError::new_err(format!(
                "{} of the readings say something: at least {LEAST_BEAMS} are needed",
                beams.len()
            )));
        }
        let pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
        Ok(inverse::Sweep { scan: Uuid::nil(), pose, beams })
    }
}

/// Fewer say too little about three values of a pose.
const LEAST_BEAMS: usize = 8;
