//! The model of an array of rangers.

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

use super::{RangerArray, meant, predict};
use crate::{
    air::Air,
    arrays, error,
    options::{self, Words},
    path,
    pool::OfProcess,
    scene::{self, Scene},
    sensor::{self, Sensor},
};

/// Predicts what the rangers of an array read in a scene, with crosstalk: rangers that fire at once, or before the
/// sound of an earlier turn has died away, hear one another.
///
/// Parameters
/// ----------
/// scene : Scene or str
///     The scene, or the name of a shipped one.
/// array : RangerArray or str
///     The array, or the name of a preset.
/// sensor : Sensor or str, optional
///     The kind of its rangers; the array's own without it.
/// air : Air, optional
///     The air; 20 degrees Celsius, 50 percent and one atmosphere without it.
/// engine, max_range_m, threshold, response, ideal_receiver, lossless, max_order, edge_law, double_diffraction, \
/// ray_spacing_deg, aperture_deg
///     As of ``Model``. No ranger listens for longer than the array's interval.
/// without_crosstalk : bool
///     Leave out what a ranger receives of other firings than its own; with ``paths``, the others know none.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct ArrayModel {
    scene: Py<Scene>,
    array: Py<RangerArray>,
    sensor: Py<Sensor>,
    air: Air,
    options: Options,
    model: OfProcess<model::ArrayModel>,
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
        let words = Words { engine, response, edge_law };
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
        let options = options::options(py, &words, keys)?;
        let (scene, array) = (scene::meant(scene)?, meant(array)?);
        let sensor = match sensor {
            Some(sensor) => sensor::meant(sensor)?,
            None => Py::new(py, own_sensor(py, &array.get().array.sensor)?)?,
        };
        let air = air.map_or_else(|| acoustics::Air::default().into(), |air| *air.get());
        Self::of(py, scene, array, sensor, air, options)
    }

    /// The scene.
    #[getter]
    fn scene(&self, py: Python<'_>) -> Py<Scene> {
        self.scene.clone_ref(py)
    }

    /// The array.
    #[getter]
    fn array(&self, py: Python<'_>) -> Py<RangerArray> {
        self.array.clone_ref(py)
    }

    /// The kind of its rangers.
    #[getter]
    fn sensor(&self, py: Python<'_>) -> Py<Sensor> {
        self.sensor.clone_ref(py)
    }

    /// The air.
    #[getter]
    fn air(&self) -> Air {
        self.air
    }

    /// How echoes are found: ``"paths"``, ``"fan"`` or ``"cone"``.
    #[getter]
    fn engine(&self) -> &'static str {
        self.options.engine.kind().name()
    }

    /// The options that are given, by name.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        options::given(py, &self.options)
    }

    /// Speed of sound, metres a second.
    #[getter]
    fn sound_speed_m_s(&self) -> f64 {
        self.air.air.sound_speed_m_s()
    }

    /// Farthest range that is listened for, metres.
    #[getter]
    fn max_range_m(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.simulated(py)?.simulator().receiver().max_range_m)
    }

    /// Predicted readings of whole rounds at each pose of the robot.
    ///
    /// The interpreter's lock is free meanwhile, and an interrupt (Ctrl-C) ends it.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., 3)
    ///     Where the robot stands: x and y in metres, heading in degrees counter-clockwise from +x, -360 to 360.
    /// rounds : int
    ///     Rounds at each pose, 1 to 200, between which the robot turns in place: of an even ring, so that directions
    ///     are spread evenly.
    /// threads : int, optional
    ///     As of ``Model.predict``. Results do not depend on it.
    ///
    /// Returns
    /// -------
    /// ndarray of dtype ARRAY_READING, shape (..., rounds * firings)
    ///     In the order of ``array.round``. As of ``Model.predict``, with ``crosstalk`` (int16): the ranger whose sound it
    ///     was, an index into ``array.ids``; -1 if its own.
    ///
    /// Raises
    /// ------
    /// PoseError
    ///     If the robot or one of its rangers can't stand at one of the poses; nothing is predicted then.
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

    /// Predicted readings of a robot that moves: one firing at each pose.
    ///
    /// ``model.fire(course.poses_at(model.array.firing_times_s(rounds)))`` drives a ``Course``. Each ranger is predicted as if
    /// the robot had stood there for a while.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., n, 3)
    ///     The robot's at each firing; along the axis before the last the firings of a round follow each other, over and
    ///     over again.
    /// threads : int, optional
    ///     As of ``Model.predict``.
    ///
    /// Returns
    /// -------
    /// ndarray of dtype ARRAY_READING, shape (..., n)
    ///     As of ``predict``.
    #[pyo3(signature = (poses, threads = None))]
    fn fire<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        predict::fire(self, py, poses, threads)
    }

    /// One predicted reading with the path of its sound.
    ///
    /// Parameters
    /// ----------
    /// pose : array_like, shape (3,)
    ///     The robot's: x and y (metres) and heading (degrees).
    /// firing : int
    ///     Which of a round, from 0: an index into ``array.round``.
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
        let other = reading.crosstalk.map(|other| &*rangers.rangers[other.ranger].id);
        path::reading(py, &scene, &reading, other)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (array, scene) = (&self.rangers().name, &self.bare_scene().name);
        Ok(format!(
            "<ArrayModel of '{array}' in '{scene}', {}>",
            options::shown(py, &self.options)?
        ))
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let made_of = (self.scene(py), self.array(py), self.sensor(py), self.air, self.engine());
        Ok((made_of.into_pyobject(py)?, self.options(py)?))
    }
}

impl ArrayModel {
    pub(crate) fn of(
        py: Python<'_>,
        scene: Py<Scene>,
        array: Py<RangerArray>,
        sensor: Py<Sensor>,
        air: Air,
        options: Options,
    ) -> PyResult<Self> {
        let make = || made(scene.get(), array.get(), sensor.get(), air, options);
        let model = py.detach(make).map_err(|error| error::model(py, &error))?;
        Ok(Self { scene, array, sensor, air, options, model: OfProcess::new(model) })
    }

    /// The model of this process.
    pub(super) fn simulated(&self, py: Python<'_>) -> PyResult<Arc<model::ArrayModel>> {
        let Self { scene, array, sensor, air, options, .. } = self;
        let make = || made(scene.get(), array.get(), sensor.get(), *air, *options);
        self.model.get(py, make).map_err(|error| error::model(py, &error))
    }

    pub(super) fn rangers(&self) -> &array::RangerArray {
        &self.array.get().array
    }

    /// The scene without the robot's body.
    pub(super) fn bare_scene(&self) -> &model_scene::Scene {
        &self.scene.get().scene
    }
}

fn made(
    scene: &Scene,
    array: &RangerArray,
    sensor: &Sensor,
    air: Air,
    options: Options,
) -> Result<model::ArrayModel, ModelError> {
    let (array, scene, sensor) = (Arc::clone(&array.array), &scene.scene, &sensor.sensor);
    model::ArrayModel::new(array, scene, sensor, air.air, options)
}

/// The sensor that an array names: a file, or a preset; a file of that name wins, as with the command.
fn own_sensor(py: Python<'_>, name: &str) -> PyResult<Sensor> {
    match Path::new(name).is_file() {
        true => Sensor::load(py, name.into()),
        false => Sensor::preset(py, name),
    }
}
