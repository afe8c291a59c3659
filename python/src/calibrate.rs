//! Fits sensor, air, scene and poses to measured readings.

use std::{collections::BTreeMap, sync::Arc};

use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyDict, PyTuple},
};
use sonard::{
    inverse::{
        self, FitOptions, FitResult as Fitted, FitSweep, ParameterGroup, ParameterReport, World,
    },
    scan::Session,
};
use sonard_model::geometry::Pose;

use crate::{
    arrays::{self, PoseArray},
    error::{LogError, OptionError, SonardError, new_error},
    log::{Scan, scans_of},
    model::Model,
    options::parse_name,
    path::result,
    pool::pool,
    scene::Scene,
    sense::warn,
    sensor::Sensor,
};

/// Parameter groups fitted by default, as by the command.
const DEFAULT_FIT: [&str; 3] = ["pose", "air", "threshold"];

/// Fits sensor, air, scene and poses to measured readings, as ``sonard calibrate`` does.
///
/// Starts from the prior values, each with a standard deviation, and finds the values that maximise
/// the posterior probability of the readings. Parameters that the readings do not determine keep
/// their prior values.
///
/// Parameters
/// ----------
/// scans : Log, Scan or sequence of them
///     Sweeps of a single ranger on a stepper. Unusable scans are skipped with a warning.
/// model : Model, optional
///     Prior values: scene, sensor, air and options. Defaults to those of the scans, which must
///     have the same scene and sensor.
/// fit : sequence of str
///     Parameter groups to fit: ``"pose"`` (of each scan), ``"heading"`` and ``"gear"`` of the
///     stepper, ``"mounting"``, ``"height"``, ``"air"`` (speed of sound), ``"delay"``,
///     ``"threshold"``, ``"rise"`` (of the threshold with range), ``"beam"``, ``"skirts"`` (side
///     lobes), ``"pulse"`` (rise time), ``"materials"``, ``"roughness"``, ``"walls"``,
///     ``"turns"`` and ``"ends"`` of walls, ``"posts"`` (cylinders); ``sonard calibrate --help``
///     describes them.
/// priors : dict of str to float, optional
///     Standard deviation of the prior of a parameter, in its unit, by the name of its estimate.
///     Defaults to that of the command.
/// poses : array_like, shape (scans, 3), optional
///     Prior poses of the ranger: x and y (metres) and heading (degrees). Default to those of the
///     scans.
/// max_initial_error_m : float
///     Largest initial error of predicted ranges, metres, 0.005 to 1.
/// search : {'thorough', 'quick', 'furnished'}
///     Effort of the search: 'quick' is four to ten times as fast and misses the best explanation
///     more often. 'furnished' searches thoroughly and allows objects that are missing in the scene
///     to reflect or shadow many adjacent beams.
///
/// Returns
/// -------
/// Calibration
///
/// Raises
/// ------
/// LogError
///     If no scan can be used, or the scans differ in scene or sensor.
/// OptionError
///     If a requested parameter cannot be fitted.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are keywords where they are used")]
#[pyo3(signature = (scans, model = None, *, fit = None, priors = None, poses = None, max_initial_error_m = 0.1,
    search = "thorough"),
    text_signature = "(scans, model=None, *, fit=('pose', 'air', 'threshold'), priors=None, poses=None, max_initial_error_m=0.1, search='thorough')")]
pub(crate) fn calibrate<'py>(
    py: Python<'py>,
    scans: &Bound<'py, PyAny>,
    model: Option<&Bound<'py, Model>>,
    fit: Option<Vec<String>>,
    priors: Option<BTreeMap<String, f64>>,
    poses: Option<&Bound<'py, PyAny>>,
    max_initial_error_m: f64,
    search: &str,
) -> PyResult<Bound<'py, PyAny>> {
    if !(0.005..=1.0).contains(&max_initial_error_m) {
        let message =
            format!("max_initial_error_m is {max_initial_error_m}: it must be from 0.005 to 1");
        return Err(PyValueError::new_err(message));
    }
    let names = fit.unwrap_or_else(|| DEFAULT_FIT.map(str::to_owned).to_vec());
    let groups = names
        .iter()
        .map(|name| parse_name(py, "fit", name))
        .collect::<PyResult<Vec<ParameterGroup>>>()?;
    let scans = scans_of(scans)?;
    let sweeps = sweeps(py, &scans, poses)?;
    let prior = match model {
        Some(model) => model.get().world(),
        None => common_world(py, &scans)?,
    };
    let sigmas: Vec<(String, f64)> = priors.unwrap_or_default().into_iter().collect();
    let priors = inverse::priors(&groups, &sigmas, &prior, sweeps.len());
    let priors =
        priors.map_err(|error| new_error::<OptionError>(py, &error.to_string(), &error.help()))?;
    let settings = FitOptions {
        search: parse_name(py, "search", search)?,
        ..FitOptions::with_priors(priors, max_initial_error_m)
    };
    let pool = pool(py, None)?;
    let fitted = py.detach(|| pool.install(|| inverse::fit(&prior, &sweeps, &settings)));
    let fitted = fitted.map_err(|error| {
        let help = "check that the poses are inside the scene, or fit fewer parameters";
        new_error::<SonardError>(py, &error.to_string(), help)
    })?;
    if fitted.is_poorly_explained() {
        let share = 100.0 * (1.0 - fitted.errors.explained());
        warn(py, &format!("{share:.0} % of the readings are not explained: check the scene"))?;
    }
    let report = fitted.report(&prior, &sweeps, &settings);
    FitResult { prior, sweeps, fitted, report }.into_python(py)
}

/// Extracts sweeps of a single ranger from the scans, with the given poses or their own.
fn sweeps(
    py: Python<'_>,
    scans: &[Py<Scan>],
    poses: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<FitSweep>> {
    let poses = poses.map(PoseArray::from_python).transpose()?;
    if let Some(PoseArray { shape, .. }) = &poses
        && **shape != [scans.len()]
    {
        let shape = PyTuple::new(py, [&**shape, &[3]].concat())?;
        return Err(PyValueError::new_err(format!(
            "poses has the shape {shape}: it must be ({}, 3), a pose for each scan",
            scans.len()
        )));
    }
    let is_finite =
        |pose: &Pose| [pose.x_m, pose.y_m, pose.heading_deg].iter().all(|n| n.is_finite());
    if let Some(at) =
        poses.as_ref().and_then(|poses| poses.list.iter().position(|pose| !is_finite(pose)))
    {
        return Err(PyValueError::new_err(format!("poses[{at}]: values must be finite")));
    }
    let mut sweeps = Vec::new();
    for (at, scan) in scans.iter().enumerate() {
        match FitSweep::from_scan(scan.get().view()) {
            Ok(sweep) => {
                let pose = poses.as_ref().map_or(sweep.pose, |poses| poses.list[at]);
                sweeps.push(FitSweep { pose, ..sweep });
            }
            Err(error) => warn(py, &format!("{error}; scan skipped"))?,
        }
    }
    if sweeps.is_empty() {
        let help = "pass scans of a ranger on a stepper";
        return Err(new_error::<LogError>(py, "no sweep to fit", help));
    }
    Ok(sweeps)
}

/// Returns the model shared by all usable scans.
fn common_world(py: Python<'_>, scans: &[Py<Scan>]) -> PyResult<World> {
    let mut known: Option<(World, &Arc<Session>)> = None;
    for scan in scans.iter().map(Py::get).filter(|scan| FitSweep::from_scan(scan.view()).is_ok()) {
        let Some(session) = &scan.view().session else { continue };
        if known.as_ref().is_some_and(|(_, before)| Arc::ptr_eq(before, session)) {
            continue;
        }
        let own = scan.model(py, None)?.world();
        match &known {
            None => known = Some((own, session)),
            Some((first, _)) => {
                if first.sensor != own.sensor || first.scene.sha256 != own.scene.sha256 {
                    let message = "the scans have different sensors or scenes";
                    let help =
                        "calibrate scans of the same sensor and scene together, or pass a model";
                    return Err(new_error::<LogError>(py, message, help));
                }
            }
        }
    }
    let none = || new_error::<LogError>(py, "no sweep to fit", "");
    known.map(|(world, _)| world).ok_or_else(none)
}

/// Result of a fit.
struct FitResult {
    /// Prior values.
    prior: World,
    sweeps: Vec<FitSweep>,
    fitted: Fitted,
    report: Vec<ParameterReport>,
}

impl FitResult {
    fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let Fitted { world, poses, errors, .. } = &self.fitted;
        let estimates = self.report.iter().map(|parameter| {
            let scan = parameter.scan.map(|scan| scan.to_string());
            let ParameterReport {
                name, value, change, sigma, low, high, prior, prior_sigma, ..
            } = parameter;
            let fields = (
                name,
                scan,
                *value,
                *change,
                *sigma,
                *low,
                *high,
                *prior,
                *prior_sigma,
                parameter.identified,
                parameter.at_limit,
            );
            result(py, "Estimate", fields)
        });
        let estimates = PyTuple::new(py, estimates.collect::<PyResult<Vec<_>>>()?)?;
        let count = self.report.len();
        let fields = PyDict::new(py);
        fields.set_item("estimates", estimates)?;
        fields.set_item("covariance", arrays::shaped(py, self.covariance(), &[count, count])?)?;
        fields.set_item("model", Py::new(py, self.model(py)?)?)?;
        let poses = arrays::shaped(py, arrays::numbers_of(poses), &[poses.len(), 3])?;
        fields.set_item("poses", poses)?;
        let scans = self.sweeps.iter().map(|sweep| sweep.scan.to_string());
        fields.set_item("scans", PyTuple::new(py, scans.collect::<Vec<_>>())?)?;
        for (name, value) in [
            ("delay_m", world.delay_m),
            ("heading_zero_deg", world.heading_zero_deg),
            ("gear", world.gear),
            ("explained", errors.explained()),
            ("sigma_m", errors.sigma_m),
            ("sigma_db", errors.sigma_db),
            ("log_likelihood", self.fitted.log_likelihood),
            ("log_posterior", self.fitted.log_posterior),
        ] {
            fields.set_item(name, value)?;
        }
        fields.set_item("readings", self.fitted.readings)?;
        py.import("sonard._results")?.getattr("Calibration")?.call((), Some(&fields))
    }

    /// Covariance of the reported values, to first order, including those that are fitted as
    /// logarithms.
    fn covariance(&self) -> Vec<f64> {
        let of_fit = &self.fitted.covariance;
        let scale = |at: usize| self.report[at].sigma / of_fit[(at, at)].sqrt();
        let indices = 0..self.report.len();
        let entry = |row: usize, column: usize| of_fit[(row, column)] * scale(row) * scale(column);
        indices
            .clone()
            .flat_map(|row| indices.clone().map(move |column| (row, column)))
            .map(|(row, column)| entry(row, column))
            .collect()
    }

    /// Model with the fitted values, without those that a model does not contain: delay and
    /// stepper.
    fn model(&self, py: Python<'_>) -> PyResult<Model> {
        let world = &self.fitted.world;
        let scene = Scene::from_json(py, &world.scene.updated_text())?;
        let sensor = Sensor { sensor: self.fitted.sensor(&self.prior.sensor) };
        Model::build(py, Py::new(py, scene)?, Py::new(py, sensor)?, world.air.into(), world.options)
    }
}
