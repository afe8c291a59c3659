//! What sensor, air, scene and poses explain readings best.

use std::{collections::BTreeMap, sync::Arc};

use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyDict, PyTuple},
};
use sonard::{
    inverse::{self, Fit, Fitted, Group, Sweep, Told, World},
    scan::Session,
};
use sonard_model::geometry::Pose;

use crate::{
    arrays::{self, Poses},
    error::{LogError, OptionError, SonardError, refuse},
    log::{Scan, scans_of},
    model::Model,
    options::word,
    path::result,
    pool::pool,
    scene::Scene,
    sense::warn,
    sensor::Sensor,
};

/// What is fitted without a word, as by the command.
const USUAL: [&str; 3] = ["pose", "air", "threshold"];

/// Fits sensor, air, scene and poses to what was measured, as ``sonard calibrate`` does.
///
/// Starts from what is believed, with a doubt about each parameter, and finds the values with which the model explains
/// the readings best. What the readings can't tell stays where it was.
///
/// Parameters
/// ----------
/// scans : Log, Scan or sequence of them
///     Sweeps of one ranger on a stepper; those that can't be used are left out with a warning.
/// model : Model, optional
///     What is believed: scene, sensor, air and options; without it what the scans say, which must be of one scene and
///     sensor.
/// fit : sequence of str
///     What to fit: ``"pose"`` (of each scan), ``"heading"`` and ``"gear"`` of the stepper, ``"mounting"``, ``"height"``,
///     ``"air"`` (speed of sound), ``"delay"``, ``"threshold"``, ``"rise"`` (of the threshold with range), ``"beam"``,
///     ``"skirts"``, ``"pulse"`` (how fast it rises), ``"materials"``, ``"roughness"``, ``"walls"``;
///     ``sonard calibrate --help`` tells of each.
/// priors : dict of str to float, optional
///     Standard deviation of what is believed of a parameter, by the name that its estimate has, in its unit; the
///     command's without it.
/// poses : array_like, shape (scans, 3), optional
///     Where the ranger is believed to have stood: x and y (metres) and heading (degrees); the scans' own without it.
/// widest_m : float
///     Largest initial error of predicted ranges, metres, 0.005 to 1.
/// search : {'thorough', 'quick', 'furnished'}
///     How much to search: 'quick' is four to ten times as fast and misses the likeliest explanation more often; 'furnished' searches
///     thoroughly, and things that the scene lacks may answer or hide many beams in a row.
///
/// Returns
/// -------
/// Calibration
///
/// Raises
/// ------
/// LogError
///     If no scan can be used, or they are not of one scene and sensor.
/// OptionError
///     If something can't be fitted.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are keywords where they are used")]
#[pyo3(signature = (scans, model = None, *, fit = None, priors = None, poses = None, widest_m = 0.1,
    search = "thorough"),
    text_signature = "(scans, model=None, *, fit=('pose', 'air', 'threshold'), priors=None, poses=None, widest_m=0.1, search='thorough')")]
pub(crate) fn calibrate<'py>(
    py: Python<'py>,
    scans: &Bound<'py, PyAny>,
    model: Option<&Bound<'py, Model>>,
    fit: Option<Vec<String>>,
    priors: Option<BTreeMap<String, f64>>,
    poses: Option<&Bound<'py, PyAny>>,
    widest_m: f64,
    search: &str,
) -> PyResult<Bound<'py, PyAny>> {
    if !(0.005..=1.0).contains(&widest_m) {
        let message = format!("widest_m is {widest_m}: it must be from 0.005 to 1");
        return Err(PyValueError::new_err(message));
    }
    let names = fit.unwrap_or_else(|| USUAL.map(str::to_owned).to_vec());
    let groups =
        names.iter().map(|name| word(py, "fit", name)).collect::<PyResult<Vec<Group>>>()?;
    let scans = scans_of(scans)?;
    let sweeps = sweeps(py, &scans, poses)?;
    let believed = match model {
        Some(model) => model.get().world(),
        None => common_world(py, &scans)?,
    };
    let given: Vec<(String, f64)> = priors.unwrap_or_default().into_iter().collect();
    let priors = inverse::priors(&groups, &given, &believed, sweeps.len());
    let priors =
        priors.map_err(|error| refuse::<OptionError>(py, &error.to_string(), &error.help()))?;
    let what = Fit { search: word(py, "search", search)?, ..Fit::usual(priors, widest_m) };
    let pool = pool(py, None)?;
    let fitted = py.detach(|| pool.install(|| inverse::fit(&believed, &sweeps, &what)));
    let fitted = fitted.map_err(|error| {
        let help = "see that poses are in the scene, and fit fewer parameters";
        refuse::<SonardError>(py, &error.to_string(), help)
    })?;
    if fitted.is_doubtful() {
        let share = 100.0 * (1.0 - fitted.errors.explained());
        warn(
            py,
            &format!("{share:.0} % of the readings are not explained: is the scene the right one?"),
        )?;
    }
    let told = fitted.told(&believed, &sweeps, &what);
    Found { believed, sweeps, fitted, told }.into_python(py)
}

/// The scans that are of one ranger at one place, from the poses given or their own.
fn sweeps(
    py: Python<'_>,
    scans: &[Py<Scan>],
    poses: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Sweep>> {
    let poses = poses.map(Poses::of).transpose()?;
    if let Some(Poses { shape, .. }) = &poses
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
        poses.as_ref().and_then(|poses| poses.list.iter().position(|one| !is_finite(one)))
    {
        return Err(PyValueError::new_err(format!("poses[{at}]: its numbers must be finite")));
    }
    let mut sweeps = Vec::new();
    for (at, scan) in scans.iter().enumerate() {
        match Sweep::of(scan.get().view()) {
            Ok(sweep) => {
                let pose = poses.as_ref().map_or(sweep.pose, |poses| poses.list[at]);
                sweeps.push(Sweep { pose, ..sweep });
            }
            Err(error) => warn(py, &format!("{error}; it is left out"))?,
        }
    }
    if sweeps.is_empty() {
        let help = "give scans of a ranger on a stepper";
        return Err(refuse::<LogError>(py, "there is no sweep to fit to", help));
    }
    Ok(sweeps)
}

/// What all scans that can be used were predicted with.
fn common_world(py: Python<'_>, scans: &[Py<Scan>]) -> PyResult<World> {
    let mut known: Option<(World, &Arc<Session>)> = None;
    for scan in scans.iter().map(Py::get).filter(|scan| Sweep::of(scan.view()).is_ok()) {
        let Some(session) = &scan.view().session else { continue };
        if known.as_ref().is_some_and(|(_, before)| Arc::ptr_eq(before, session)) {
            continue;
        }
        let own = scan.model(py, None)?.world();
        match &known {
            None => known = Some((own, session)),
            Some((first, _)) => {
                if first.sensor != own.sensor || first.scene.sha256 != own.scene.sha256 {
                    let message = "the scans are of different sensors or scenes";
                    let help = "calibrate what belongs together, or give a model";
                    return Err(refuse::<LogError>(py, message, help));
                }
            }
        }
    }
    let none = || refuse::<LogError>(py, "there is no sweep to fit to", "");
    known.map(|(world, _)| world).ok_or_else(none)
}

/// What came of a fit.
struct Found {
    /// What was started from.
    believed: World,
    sweeps: Vec<Sweep>,
    fitted: Fitted,
    told: Vec<Told>,
}

impl Found {
    fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let Fitted { world, poses, errors, .. } = &self.fitted;
        let estimates = self.told.iter().map(|told| {
            let scan = told.scan.map(|scan| scan.to_string());
            let Told { name, value, change, sigma, low, high, prior, prior_sigma, .. } = told;
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
                told.identified,
                told.at_limit,
            );
            result(py, "Estimate", fields)
        });
        let estimates = PyTuple::new(py, estimates.collect::<PyResult<Vec<_>>>()?)?;
        let count = self.told.len();
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

    /// Of the values that are told, to first order: what is a logarithm in the fit is none there.
    fn covariance(&self) -> Vec<f64> {
        let of_fit = &self.fitted.covariance;
        let scale = |at: usize| self.told[at].sigma / of_fit[(at, at)].sqrt();
        let places = 0..self.told.len();
        let entry = |one: usize, other: usize| of_fit[(one, other)] * scale(one) * scale(other);
        places
            .clone()
            .flat_map(|one| places.clone().map(move |other| (one, other)))
            .map(|(one, other)| entry(one, other))
            .collect()
    }

    /// The world that was found, without what a model does not know: delay and stepper.
    fn model(&self, py: Python<'_>) -> PyResult<Model> {
        let world = &self.fitted.world;
        let scene = Scene::from_json(py, &world.scene.rewritten())?;
        let sensor = Sensor { sensor: self.fitted.sensor(&self.believed.sensor) };
        Model::of(py, Py::new(py, scene)?, Py::new(py, sensor)?, world.air.into(), world.options)
    }
}
