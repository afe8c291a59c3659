//! Localisation of sweeps in a scene.

use std::collections::BTreeMap;

use pyo3::{exceptions::PyValueError, prelude::*};
use sonard::inverse::{self, ParameterGroup};
use sonard_model::geometry::Pose;
use uuid::Uuid;

use crate::{
    error::{LogError, OptionError, SonardError, new_error},
    json,
    log::Scan,
    model::Model,
    options::parse_name,
    pool::pool,
    readings::BeamReadings,
    sense::warn,
};

/// Finds the pose of a sweep without an initial guess.
///
/// The constructor predicts the readings on a grid of positions; ``locate`` then searches the grid
/// and refines the best matches.
///
/// Parameters
/// ----------
/// model : Model
///     Model with the scene to locate in.
/// spacing_m : float, optional
///     Spacing of the grid, metres, 0.01 to 2. Defaults to 0.05 in small scenes, up to 0.1 in
///     others.
/// fit : sequence of str, optional
///     Parameters to fit to each sweep in addition to its pose, named as for ``calibrate``:
///     ``"threshold"`` for another unit of the model's sensor.
/// priors : dict of str to float, optional
///     Standard deviation of the prior of a fitted parameter; see ``calibrate``.
///
/// Raises
/// ------
/// OptionError
///     If a requested parameter cannot be fitted.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Locator {
    model: Py<Model>,
    world: inverse::World,
    atlas: inverse::CoarseGrid,
    spacing_m: f64,
    fit: Vec<String>,
    priors: BTreeMap<String, f64>,
}

/// Arguments of the constructor, for pickling.
type Arguments = (Py<Model>, f64, Vec<String>, BTreeMap<String, f64>);

#[pymethods]
impl Locator {
    #[new]
    #[pyo3(signature = (model, spacing_m = None, fit = None, priors = None))]
    fn new(
        py: Python<'_>,
        model: Py<Model>,
        spacing_m: Option<f64>,
        fit: Option<Vec<String>>,
        priors: Option<BTreeMap<String, f64>>,
    ) -> PyResult<Self> {
        let world = model.get().world();
        let spacing_m =
            spacing_m.unwrap_or_else(|| inverse::CoarseGrid::default_spacing_m(&world.scene));
        if !(0.01..=2.0).contains(&spacing_m) {
            let message = format!("spacing_m is {spacing_m}: it must be from 0.01 to 2");
            return Err(PyValueError::new_err(message));
        }
        let (fit, priors) = (fit.unwrap_or_default(), priors.unwrap_or_default());
        let extra_priors = extra_priors(py, &fit, &priors, &world)?;
        let pool = pool(py, None)?;
        let atlas = py.detach(|| pool.install(|| inverse::CoarseGrid::new(&world, spacing_m)));
        let atlas = atlas.map_err(|error| new_error::<SonardError>(py, &error.to_string(), ""))?;
        Ok(Self { model, world, atlas: atlas.with_nuisance(extra_priors), spacing_m, fit, priors })
    }

    /// Poses that explain a sweep, most probable first.
    ///
    /// Parameters
    /// ----------
    /// readings : Scan or array_like, shape (beams,)
    ///     Sweep from a single position: a scan of a log, readings as returned by
    ///     ``Model.predict``, or ranges in metres, with ``inf`` for no echo and ``nan`` for a
    ///     missing measurement.
    /// azimuths_deg : array_like, shape (beams,), optional
    ///     Azimuths of the beams, degrees. Default to 400 azimuths from 0 to 359.1, or to those of
    ///     the scan.
    ///
    /// Returns
    /// -------
    /// list of dict
    ///     ``x_m``, ``y_m``, ``heading_deg``, ``probability``, ``sigma_x_m``, ``sigma_y_m``,
    ///     ``sigma_heading_deg`` and ``explained``, the fraction of the readings that the pose
    ///     explains. With ``fit`` also ``besides``, a list of dict with ``name``, ``value`` and
    ///     ``sigma``.
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
                let diagnoses = inverse::diagnose(&self.world, &self.atlas, &sweep, &modes);
                Ok::<_, inverse::FitError>((modes, diagnoses))
            })
        });
        let (modes, diagnoses) =
            found.map_err(|error| new_error::<SonardError>(py, &error.to_string(), ""))?;
        diagnoses.iter().try_for_each(|diagnosis| warn(py, &diagnosis.to_string()))?;
        json::to_python(py, &modes)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let model: String = self.model.bind(py).repr()?.extract()?;
        Ok(format!("<Locator, {} m apart, by {model}>", self.spacing_m))
    }

    fn __getnewargs__(&self, py: Python<'_>) -> Arguments {
        (self.model.clone_ref(py), self.spacing_m, self.fit.clone(), self.priors.clone())
    }
}

impl Locator {
    fn sweep(
        &self,
        py: Python<'_>,
        readings: &Bound<'_, PyAny>,
        azimuths_deg: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<inverse::FitSweep> {
        if let Ok(scan) = readings.cast::<Scan>() {
            if azimuths_deg.is_some() {
                return Err(PyValueError::new_err("azimuths_deg must be omitted for a scan"));
            }
            return inverse::FitSweep::from_scan(scan.get().view())
                .map_err(|error| new_error::<LogError>(py, &error.to_string(), ""));
        }
        let given = BeamReadings::from_python(readings)?;
        let beams = given.firings(azimuths_deg, self.world.air.sound_speed_m_s())?;
        if beams.len() < MIN_BEAMS {
            return Err(PyValueError::new_err(format!(
                "{} usable readings: at least {MIN_BEAMS} are required",
                beams.len()
            )));
        }
        let pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
        Ok(inverse::FitSweep { scan: Uuid::nil(), pose, beams })
    }
}

/// Returns the priors of the parameters that are fitted in addition to a pose.
fn extra_priors(
    py: Python<'_>,
    fit: &[String],
    priors: &BTreeMap<String, f64>,
    world: &inverse::World,
) -> PyResult<Vec<inverse::Prior>> {
    let groups = fit
        .iter()
        .map(|name| parse_name(py, "fit", name))
        .collect::<PyResult<Vec<ParameterGroup>>>()?;
    let given: Vec<(String, f64)> = priors.clone().into_iter().collect();
    let found = inverse::priors(&groups, &given, world, 1);
    found.map_err(|error| new_error::<OptionError>(py, &error.to_string(), &error.help()))
}

/// Minimum number of beams that determine the three values of a pose.
const MIN_BEAMS: usize = 8;
