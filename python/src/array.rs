//! Python classes for arrays of rangers.

mod course;
mod model;
mod predict;

use std::{
    fs,
    hash::{DefaultHasher, Hash as _, Hasher as _},
    path::PathBuf,
    sync::Arc,
};

use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
    types::PyType,
};
use sonard_model::array;

pub(crate) use course::Course;
pub(crate) use model::{ArrayModel, own_sensor};

use crate::{
    arrays::{self, PoseArray},
    error::{self, ArrayError, new_error},
    json,
};

/// Maximum number of rounds per pose, as for the command.
const MAX_ROUNDS: u32 = 200;

/// Rangers of one kind at fixed bearings on a robot, fired in turn.
///
/// Created by ``RangerArray.preset("pioneer-8")``, ``RangerArray.from_json(text)`` and
/// ``RangerArray.load(path)``. Positions are in the robot's frame: x ahead, y to the left.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct RangerArray {
    pub(crate) array: Arc<array::RangerArray>,
}

#[pymethods]
impl RangerArray {
    /// Returns a shipped array by its name.
    #[staticmethod]
    fn preset(py: Python<'_>, name: &str) -> PyResult<Self> {
        Self::from_result(py, array::RangerArray::preset(name))
    }

    /// Names of the presets.
    #[staticmethod]
    fn preset_names() -> Vec<&'static str> {
        array::RangerArray::preset_names().collect()
    }

    /// Creates an array from the text of a data file.
    #[staticmethod]
    fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        Self::from_result(py, array::RangerArray::from_json(text))
    }

    /// Creates an array from a data file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let text =
            fs::read_to_string(&path).map_err(|error| error::unreadable(py, path, &error))?;
        Self::from_json(py, &text)
    }

    /// Text of the data file.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        serde_json::to_string_pretty(&*self.array)
            .map_err(|error| new_error::<ArrayError>(py, &error.to_string(), ""))
    }

    /// Name of the preset.
    #[getter]
    fn name(&self) -> &str {
        &self.array.name
    }

    /// Description in a sentence.
    #[getter]
    fn description(&self) -> &str {
        &self.array.description
    }

    /// Kind of all rangers: a sensor preset, or a sensor file.
    #[getter]
    fn sensor(&self) -> &str {
        &self.array.sensor
    }

    /// Interval between firing slots, milliseconds, which is also the listening window of a ranger.
    #[getter]
    fn interval_ms(&self) -> f64 {
        self.array.interval_ms
    }

    /// Names of the rangers.
    #[getter]
    fn ids(&self) -> Vec<&str> {
        self.array.rangers.iter().map(|ranger| &*ranger.id).collect()
    }

    /// Mounting positions of the rangers: array of shape (rangers, 3) of metres ahead, metres to
    /// the left, and bearings in degrees counter-clockwise from the heading; in the order of
    /// ``ids``.
    #[getter]
    fn mounts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rangers = &self.array.rangers;
        let numbers =
            rangers.iter().flat_map(|ranger| [ranger.x_m, ranger.y_m, ranger.bearing_deg]);
        arrays::shaped(py, numbers.collect(), &[rangers.len(), 3])
    }

    /// Firing slots of a round, each a list of the names of the rangers that fire simultaneously.
    #[getter]
    fn slots(&self) -> Vec<Vec<&str>> {
        let id = |ranger: usize| &*self.array.rangers[ranger].id;
        self.array.slots().into_iter().map(|turn| turn.into_iter().map(id).collect()).collect()
    }

    /// Names of the rangers in the order in which a round fires them.
    #[getter]
    fn round(&self) -> Vec<&str> {
        self.slots().concat()
    }

    /// Body of the robot, which is opaque to sound, as in the data file; ``None`` without a body.
    #[getter]
    fn body<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.array.body.as_ref().map(|body| json::to_python(py, body)).transpose()
    }

    /// Sources of the values, by name.
    #[getter]
    fn sources<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.array.sources)
    }

    /// Start times of the firings of some rounds, seconds after the first: shape (rounds * firings
    /// of a round,).
    #[pyo3(signature = (rounds = 1))]
    fn firing_times_s<'py>(&self, py: Python<'py>, rounds: u32) -> PyResult<Bound<'py, PyAny>> {
        let times_s = self.array.firing_times_s(checked_rounds(rounds)?);
        let count = times_s.len();
        arrays::shaped(py, times_s, &[count])
    }

    /// Poses of the rangers in the world.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., 3)
    ///     Poses of the robot: x and y in metres, heading in degrees counter-clockwise from +x.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (..., rangers, 3)
    ///     x and y of each ranger's face (metres) and the direction of its beam axis (degrees).
    fn ranger_poses<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let PoseArray { list, shape } = PoseArray::from_python(poses)?;
        let on = list.iter().flat_map(|robot| {
            let poses = self.array.rangers.iter().map(|ranger| ranger.world_pose(robot));
            poses.flat_map(|pose| [pose.x_m, pose.y_m, pose.heading_deg])
        });
        arrays::shaped(py, on.collect(), &[&*shape, &[self.array.rangers.len(), 3]].concat())
    }

    fn __repr__(&self) -> String {
        let array::RangerArray { name, rangers, sensor, interval_ms, .. } = &*self.array;
        let count = rangers.len();
        format!("<RangerArray '{name}': {count} rangers '{sensor}', one each {interval_ms} ms>")
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.array == other.get().array)
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        (&self.array.name, self.array.rangers.len()).hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((PyType::new::<Self>(py).getattr("from_json")?, (self.to_json(py)?,)))
    }
}

impl RangerArray {
    /// Creates an array that was read from a log.
    pub(crate) fn checked(py: Python<'_>, array: array::RangerArray) -> PyResult<Self> {
        Self::from_result(py, array.check().map(|()| array))
    }

    fn from_result(
        py: Python<'_>,
        result: Result<array::RangerArray, array::ArrayError>,
    ) -> PyResult<Self> {
        let array = result.map_err(|error| error::array(py, &error))?;
        Ok(Self { array: Arc::new(array) })
    }
}

/// Resolves a `RangerArray` or the name of a preset.
pub(crate) fn resolve(given: &Bound<'_, PyAny>) -> PyResult<Py<RangerArray>> {
    if let Ok(array) = given.cast::<RangerArray>() {
        return Ok(array.clone().unbind());
    }
    let Ok(name) = given.extract::<String>() else {
        let kind = given.get_type();
        return Err(PyTypeError::new_err(format!(
            "array is a {kind}: must be a RangerArray or the name of a preset"
        )));
    };
    Py::new(given.py(), RangerArray::preset(given.py(), &name)?)
}

fn checked_rounds(rounds: u32) -> PyResult<u32> {
    if (1..=MAX_ROUNDS).contains(&rounds) {
        return Ok(rounds);
    }
    let message = format!("rounds is {rounds}: it must be 1 to {MAX_ROUNDS}");
    Err(PyValueError::new_err(message))
}
