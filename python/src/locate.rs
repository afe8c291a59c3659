//! Where scans were taken.

use std::collections::BTreeMap;

use pyo3::{exceptions::PyValueError, prelude::*};
use sonard::inverse::{self, Group};
use sonard_model::{geometry::Pose, reading::PingStatus};
use uuid::Uuid;

use crate::{
    error::{LogError, OptionError, SonardError, refuse},
    json,
    log::Scan,
    model::Model,
    options::word,
    pool::pool,
    readings::Heard,
    sense::warn,
};

/// Finds where a sweep was taken, without a guess.
///
/// Predicts what would be read on a grid of places when it is made; ``locate`` then looks up and improves what fits.
///
/// Parameters
/// ----------
/// model : Model
///     With the scene to locate in.
/// spacing_m : float, optional
///     Spacing of the grid, metres, 0.01 to 2; without it 0.05 in small scenes to 0.1.
/// fit : sequence of str, optional
///     What is fitted to each sweep besides its pose, as ``calibrate`` names it: ``"threshold"`` for a ranger of the same
///     kind as the model's, but not the same.
/// priors : dict of str to float, optional
///     Standard deviation of what is believed of a parameter that is fitted; see ``calibrate``.
///
/// Raises
/// ------
/// OptionError
///     If something can't be fitted.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Locator {
    model: Py<Model>,
    world: inverse::World,
    atlas: inverse::Atlas,
    spacing_m: f64,
    fit: Vec<String>,
    priors: BTreeMap<String, f64>,
}

/// What a locator is made of again.
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
        let spacing_m = spacing_m.unwrap_or_else(|| inverse::Atlas::usual_spacing_m(&world.scene));
        if !(0.01..=2.0).contains(&spacing_m) {
            let message = format!("spacing_m is {spacing_m}: it must be from 0.01 to 2");
            return Err(PyValueError::new_err(message));
        }
        let (fit, priors) = (fit.unwrap_or_default(), priors.unwrap_or_default());
        let besides = besides(py, &fit, &priors, &world)?;
        let pool = pool(py, None)?;
        let atlas = py.detach(|| pool.install(|| inverse::Atlas::new(&world, spacing_m)));
        let atlas = atlas.map_err(|error| refuse::<SonardError>(py, &error.to_string(), ""))?;
        Ok(Self { model, world, atlas: atlas.fitting(besides), spacing_m, fit, priors })
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
    ///     and ``explained``, the share of the readings that the pose explains; of a locator with ``fit`` also ``besides``,
    ///     a list of dict with ``name``, ``value`` and ``sigma``.
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
                    PingStatus::MinRange => inverse::Heard::Near,
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

/// The parameters that are fitted besides a pose, with what is believed of them.
fn besides(
    py: Python<'_>,
    fit: &[String],
    priors: &BTreeMap<String, f64>,
    world: &inverse::World,
) -> PyResult<Vec<inverse::Prior>> {
    let groups = fit.iter().map(|name| word(py, "fit", name)).collect::<PyResult<Vec<Group>>>()?;
    let given: Vec<(String, f64)> = priors.clone().into_iter().collect();
    let found = inverse::priors(&groups, &given, world, 1);
    found.map_err(|error| refuse::<OptionError>(py, &error.to_string(), &error.help()))
}

/// Fewer say too little about three values of a pose.
const LEAST_BEAMS: usize = 8;
