//! Python class for the model of an array of rangers.

use std::{path::Path, sync::Arc};

use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyDict, PyTuple},
};
use sonard_model::{
    acoustics, array,
    model::{self, ModelError, OptionKeys, Options},
    scene as model_scene,
};

use super::{RangerArray, predict, resolve};
use crate::{
    air::Air,
    arrays, error,
    options::{self, NamedOptions},
    path,
    pool::PerProcess,
    scene::{self, Scene},
    sensor::{self, Sensor},
};

/// Predicts the readings of the rangers of an array in a scene, including crosstalk: rangers that
/// fire simultaneously, or before the sound of an earlier firing slot has decayed, receive each
/// other's sound.
///
/// Parameters
/// ----------
/// scene : Scene or str
///     Scene, or the name of a shipped one.
/// array : RangerArray or str
///     Array, or the name of a preset.
/// sensor : Sensor or str, optional
///     Kind of the rangers. Defaults to that of the array.
/// air : Air, optional
///     State of the air. Defaults to 20 degrees Celsius, 50 percent and one atmosphere.
/// engine, max_range_m, threshold, response, ideal_receiver, lossless, max_order, edge_law, double_diffraction, \
/// ray_spacing_deg, aperture_deg
///     As for ``Model``. The listening window of a ranger is at most the interval of the array.
/// without_crosstalk : bool
///     Ignore the sound of other rangers' firings; with ``paths``. The other engines never include
///     it.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct ArrayModel {
    scene: Py<Scene>,
    array: Py<RangerArray>,
    sensor: Py<Sensor>,
    air: Air,
    options: Options,
    model: PerProcess<model::ArrayModel>,
}

#[pymethods]
impl ArrayModel {
    #[new]
    #[pyo3(signature = (scene, array, sensor = None, air = None, engine = "paths", *, max_range_m = None, threshold = None, response = None, ideal_receiver = false, lossless = false, max_order = None, edge_law = None, double_diffraction = false, without_crosstalk = false, ray_spacing_deg = None, aperture_deg = None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords where they are used")]
    fn new(
        py: Python<'_>,
        scene: &Bound<'_, PyAny>,
        array: &Bound<'_, PyAny>,
        sensor: Option<&Bound<'_, PyAny>>,
        air: Option<&Bound<'_, Air>>,
        engine: &str,
        max_range_m: Option<f64>,
        threshold: Option<f64>,
        response: Option<&str>,
        ideal_receiver: bool,
        lossless: bool,
        max_order: Option<u32>,
        edge_law: Option<&str>,
        double_diffraction: bool,
        without_crosstalk: bool,
        ray_spacing_deg: Option<f64>,
        aperture_deg: Option<f64>,
    ) -> PyResult<Self> {
        let named = NamedOptions { engine, response, edge_law };
        let keys = OptionKeys {
            max_range_m,
            threshold,
            ideal_receiver,
            lossless,
            max_order,
            double_diffraction,
            without_crosstalk,
            ray_spacing_deg,
            aperture_deg,
            ..OptionKeys::default()
        };
        let options = options::options(py, &named, keys)?;
        let (scene, array) = (scene::resolve(scene)?, resolve(array)?);
        let sensor = match sensor {
            Some(sensor) => sensor::resolve(sensor)?,
            None => Py::new(py, own_sensor(py, &array.get().array.sensor)?)?,
        };
        let air = air.map_or_else(|| acoustics::Air::default().into(), |air| *air.get());
        Self::build(py, scene, array, sensor, air, options)
    }

    /// Scene of the model.
    #[getter]
    fn scene(&self, py: Python<'_>) -> Py<Scene> {
        self.scene.clone_ref(py)
    }

    /// Array of the model.
    #[getter]
    fn array(&self, py: Python<'_>) -> Py<RangerArray> {
        self.array.clone_ref(py)
    }

    /// Kind of the rangers.
    #[getter]
    fn sensor(&self, py: Python<'_>) -> Py<Sensor> {
        self.sensor.clone_ref(py)
    }

    /// State of the air.
    #[getter]
    fn air(&self) -> Air {
        self.air
    }

    /// Simulation engine: ``"paths"``, ``"fan"`` or ``"cone"``.
    #[getter]
    fn engine(&self) -> &'static str {
        self.options.engine.kind().name()
    }

    /// Options other than the defaults, by name.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        options::given(py, &self.options)
    }

    /// Speed of sound, metres per second.
    #[getter]
    fn sound_speed_m_s(&self) -> f64 {
        self.air.air.sound_speed_m_s()
    }

    /// Maximum range, at the end of the listening window, metres.
    #[getter]
    fn max_range_m(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.simulated(py)?.simulator().receiver().max_range_m)
    }

    /// Predicts the readings of complete rounds at each pose of the robot.
    ///
    /// Releases the interpreter lock during the computation; an interrupt (Ctrl-C) ends it.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., 3)
    ///     Poses of the robot: x and y in metres, heading in degrees counter-clockwise from +x,
    ///     -360 to 360.
    /// rounds : int
    ///     Rounds at each pose, 1 to 200. The robot turns in place between rounds, so that the
    ///     directions of a regular ring are spread evenly.
    /// threads : int, optional
    ///     As for ``Model.predict``. The results do not depend on it.
    ///
    /// Returns
    /// -------
    /// ndarray of dtype ARRAY_READING, shape (..., rounds * firings)
    ///     In the order of ``array.round``. As for ``Model.predict``, with ``crosstalk`` (int16):
    ///     index into ``array.ids`` of the ranger that transmitted the detected sound; -1 for the
    ///     ranger itself.
    ///
    /// Raises
    /// ------
    /// PoseError
    ///     If the robot or a ranger cannot be placed at one of the poses; nothing is predicted
    ///     then.
    #[pyo3(signature = (poses, rounds = 1, threads = None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        rounds: u32,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        predict::predict(self, py, poses, rounds, threads)
    }

    /// Predicts the readings of a moving robot: one firing at each pose.
    ///
    /// ``model.fire(course.poses_at(model.array.firing_times_s(rounds)))`` follows a ``Course``.
    /// Each firing is predicted as if the robot had been at rest at its pose.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., n, 3)
    ///     Pose of the robot at each firing. Along the second-last axis the firings of a round
    ///     follow each other, cyclically.
    /// threads : int, optional
    ///     As for ``Model.predict``.
    ///
    /// Returns
    /// -------
    /// ndarray of dtype ARRAY_READING, shape (..., n)
    ///     As for ``predict``.
    #[pyo3(signature = (poses, threads = None))]
    fn fire<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        predict::fire(self, py, poses, threads)
    }

    /// Predicts a single reading with its propagation path.
    ///
    /// Parameters
    /// ----------
    /// pose : array_like, shape (3,)
    ///     Pose of the robot: x and y (metres) and heading (degrees).
    /// firing : int
    ///     Number of the firing in a round, from 0: an index into ``array.round``.
    #[pyo3(signature = (pose, firing = 0))]
    fn reading<'py>(
        &self,
        py: Python<'py>,
        pose: &Bound<'py, PyAny>,
        firing: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pose = arrays::one_pose(pose)?;
        let rangers = self.rangers();
        let round: Vec<usize> = rangers.round().collect();
        let Some(&ranger) = round.get(firing) else {
            let message = format!("firing is {firing}: it must be 0 to {}", round.len() - 1);
            return Err(PyValueError::new_err(message));
        };
        let checked = rangers.check_pose(self.bare_scene(), &pose);
        checked.map_err(|error| error::array_pose(py, &[], &error))?;
        let model = self.simulated(py)?;
        let found = py.detach(|| {
            let here = model.at(pose)?;
            let reading = here.ping_in_round(firing)?;
            Ok::<_, ModelError>((Arc::clone(here.simulator(ranger).scene()), reading))
        });
        let (scene, reading) = found.map_err(|error| error::model(py, &error))?;
        let source = reading.crosstalk.map(|other| &*rangers.rangers[other.ranger].id);
        path::reading(py, &scene, &reading, source)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (array, scene) = (&self.rangers().name, &self.bare_scene().name);
        Ok(format!(
            "<ArrayModel of '{array}' in '{scene}', {}>",
            options::sanitize(py, &self.options)?
        ))
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let arguments = (self.scene(py), self.array(py), self.sensor(py), self.air, self.engine());
        Ok((arguments.into_pyobject(py)?, self.options(py)?))
    }
}

impl ArrayModel {
    pub(crate) fn build(
        py: Python<'_>,
        scene: Py<Scene>,
        array: Py<RangerArray>,
        sensor: Py<Sensor>,
        air: Air,
        options: Options,
    ) -> PyResult<Self> {
        let make = || build_model(scene.get(), array.get(), sensor.get(), air, options);
        let model = py.detach(make).map_err(|error| error::model(py, &error))?;
        Ok(Self { scene, array, sensor, air, options, model: PerProcess::new(model) })
    }

    /// Returns the model of this process.
    pub(super) fn simulated(&self, py: Python<'_>) -> PyResult<Arc<model::ArrayModel>> {
        let Self { scene, array, sensor, air, options, .. } = self;
        let make = || build_model(scene.get(), array.get(), sensor.get(), *air, *options);
        self.model.get(py, make).map_err(|error| error::model(py, &error))
    }

    pub(super) fn rangers(&self) -> &array::RangerArray {
        &self.array.get().array
    }

    /// Returns the scene without the robot's body.
    pub(super) fn bare_scene(&self) -> &model_scene::Scene {
        &self.scene.get().scene
    }
}

fn build_model(
    scene: &Scene,
    array: &RangerArray,
    sensor: &Sensor,
    air: Air,
    options: Options,
) -> Result<model::ArrayModel, ModelError> {
    let (array, scene, sensor) = (Arc::clone(&array.array), &scene.scene, &sensor.sensor);
    model::ArrayModel::new(array, scene, sensor, air.air, options)
}

/// Returns the sensor that an array names: a file, or a preset. An existing file takes precedence,
/// as for the command.
pub(crate) fn own_sensor(py: Python<'_>, name: &str) -> PyResult<Sensor> {
    match Path::new(name).is_file() {
        true => Sensor::load(py, name.into()),
        false => Sensor::preset(py, name),
    }
}
