//! Arrays of rangers.

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
pub(crate) use model::ArrayModel;

use crate::{
    arrays::{self, Poses},
    error::{self, ArrayError, refuse},
    json,
};

/// Most rounds that can be asked for at a pose, as of the command.
const MOST_ROUNDS: u32 = 200;

/// Rangers of one kind at fixed bearings on a robot, fired in turn.
///
/// ``RangerArray.preset("pioneer-8")``, ``RangerArray.from_json(text)`` and ``RangerArray.load(path)`` make one.
/// Places are in the robot's frame: x ahead, y to the left.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct RangerArray {
    pub(crate) array: Arc<array::RangerArray>,
}

#[pymethods]
impl RangerArray {
    /// An array that comes with the package, by its name.
    #[staticmethod]
    fn preset(py: Python<'_>, name: &str) -> PyResult<Self> {
        Self::of(py, array::RangerArray::preset(name))
    }

    /// The names of the presets.
    #[staticmethod]
    fn preset_names() -> Vec<&'static str> {
        array::RangerArray::preset_names().collect()
    }

    /// An array from the text of a data file.
    #[staticmethod]
    fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        Self::of(py, array::RangerArray::from_json(text))
    }

    /// An array from a data file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let text =
            fs::read_to_string(&path).map_err(|error| error::unreadable(py, path, &error))?;
        Self::from_json(py, &text)
    }

    /// The text of its data file.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        serde_json::to_string_pretty(&*self.array)
            .map_err(|error| refuse::<ArrayError>(py, &error.to_string(), ""))
    }

    /// The preset's name.
    #[getter]
    fn name(&self) -> &str {
        &self.array.name
    }

    /// What it is, in a sentence.
    #[getter]
    fn description(&self) -> &str {
        &self.array.description
    }

    /// What kind of ranger all of them are: a sensor preset, or a file with a sensor's data.
    #[getter]
    fn sensor(&self) -> &str {
        &self.array.sensor
    }

    /// From one turn to the next, milliseconds; a ranger listens for as long.
    #[getter]
    fn interval_ms(&self) -> f64 {
        self.array.interval_ms
    }

    /// The rangers' names.
    #[getter]
    fn ids(&self) -> Vec<&str> {
        self.array.rangers.iter().map(|ranger| &*ranger.id).collect()
    }

    /// Where the rangers are on the robot: array of shape (rangers, 3) of metres ahead, metres to the left, and
    /// bearings in degrees counter-clockwise from the heading; in the order of ``ids``.
    #[getter]
    fn mounts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rangers = &self.array.rangers;
        let numbers = rangers.iter().flat_map(|one| [one.x_m, one.y_m, one.bearing_deg]);
        arrays::shaped(py, numbers.collect(), &[rangers.len(), 3])
    }

    /// The turns of a round, each a list of the names of the rangers that fire at once.
    #[getter]
    fn turns(&self) -> Vec<Vec<&str>> {
        let id = |ranger: usize| &*self.array.rangers[ranger].id;
        self.array.turns().into_iter().map(|turn| turn.into_iter().map(id).collect()).collect()
    }

    /// The names of the rangers in the order in which a round fires them.
    #[getter]
    fn round(&self) -> Vec<&str> {
        self.turns().concat()
    }

    /// The robot's body, which sound does not pass, as in the data file; ``None`` without one.
    #[getter]
    fn body<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.array.body.as_ref().map(|body| json::to_python(py, body)).transpose()
    }

    /// Where each figure comes from, by its name.
    #[getter]
    fn sources<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.array.sources)
    }

    /// When each firing of some rounds begins, seconds after the first: shape (rounds * firings of a round,).
    #[pyo3(signature = (rounds = 1))]
    fn firing_times_s<'py>(&self, py: Python<'py>, rounds: u32) -> PyResult<Bound<'py, PyAny>> {
        let times_s = self.array.firing_times_s(checked_rounds(rounds)?);
        let count = times_s.len();
        arrays::shaped(py, times_s, &[count])
    }

    /// Where the rangers stand and look in the world.
    ///
    /// Parameters
    /// ----------
    /// poses : array_like, shape (..., 3)
    ///     The robot's: x and y in metres, heading in degrees counter-clockwise from +x.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (..., rangers, 3)
    ///     x and y of each ranger's face (metres) and the direction in which it looks (degrees).
    fn poses_on<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let Poses { list, shape } = Poses::of(poses)?;
        let on = list.iter().flat_map(|robot| {
            let poses = self.array.rangers.iter().map(|ranger| ranger.pose_on(robot));
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
    /// One that was read of a log.
    pub(crate) fn checked(py: Python<'_>, array: array::RangerArray) -> PyResult<Self> {
        Self::of(py, array.check().map(|()| array))
    }

    fn of(py: Python<'_>, made: Result<array::RangerArray, array::ArrayError>) -> PyResult<Self> {
        let array = made.map_err(|error| error::array(py, &error))?;
        Ok(Self { array: Arc::new(array) })
    }
}

/// The array meant by a `RangerArray` or by a preset's name.
fn meant(given: &Bound<'_, PyAny>) -> PyResult<Py<RangerArray>> {
    if let Ok(array) = given.cast::<RangerArray>() {
        return Ok(array.clone().unbind());
    }
    let Ok(name) = given.extract::<String>() else {
        let kind = given.get_type();
        return Err(PyTypeError::new_err(format!(
            "array is a {kind}: give a RangerArray or a preset's name"
        )));
    };
    Py::new(given.py(), RangerArray::preset(given.py(), &name)?)
}

fn checked_rounds(rounds: u32) -> PyResult<u32> {
    if (1..=MOST_ROUNDS).contains(&rounds) {
        return Ok(rounds);
    }
    let message = format!("rounds is {rounds}: it must be 1 to {MOST_ROUNDS}");
    Err(PyValueError::new_err(message))
}
