//! NumPy arrays in and out: poses, points, azimuths, readings.

use numpy::{AllowTypeChange, PyArray1, PyArrayLikeDyn, PyUntypedArrayMethods as _};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyDict, PyTuple},
};
use sonard_model::{
    geometry::{DVec2, Pose},
    model::Prediction,
    reading::PingStatus,
};

use crate::status;

/// What may be given for an array of numbers.
pub(crate) type Numbers<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// Words of eight bytes that a reading takes: its status with seven bytes of filling, and four numbers.
pub(crate) const READING_WORDS: usize = 5;

/// Fields of a reading: name, format and offset.
const FIELDS: [(&str, &str, usize); READING_WORDS] = [
    ("status", "u1", 0),
    ("range_m", "f8", 8),
    ("amplitude", "f8", 16),
    ("margin_db", "f8", 24),
    ("tof_us", "f8", 32),
];

/// What the readings of arrays have besides, in the filling.
const CROSSTALK: (&str, &str, usize) = ("crosstalk", "i2", 2);

/// The type of a reading in an array.
pub(crate) fn reading_dtype(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    dtype(py, &FIELDS, 8 * READING_WORDS)
}

/// The type of a reading of an array of rangers.
pub(crate) fn array_reading_dtype(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let mut fields = FIELDS.to_vec();
    fields.insert(1, CROSSTALK);
    dtype(py, &fields, 8 * READING_WORDS)
}

/// The type of a structure of these fields: name, format and offset.
pub(crate) fn dtype<'py>(
    py: Python<'py>,
    fields: &[(&str, &str, usize)],
    itemsize: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let layout = PyDict::new(py);
    layout.set_item("names", fields.iter().map(|field| field.0).collect::<Vec<_>>())?;
    layout.set_item("formats", fields.iter().map(|field| field.1).collect::<Vec<_>>())?;
    layout.set_item("offsets", fields.iter().map(|field| field.2).collect::<Vec<_>>())?;
    layout.set_item("itemsize", itemsize)?;
    py.import("numpy")?.call_method1("dtype", (layout,))
}

/// A reading as the words of its array. Of a silence range and time of flight are infinite; what there is none
/// of is not a number.
pub(crate) fn words_of(prediction: &Prediction) -> [f64; READING_WORDS] {
    words(prediction, 0)
}

/// The same of an array's ranger, with the ranger whose sound it was if not its own, else -1.
pub(crate) fn words_of_array(prediction: &Prediction) -> [f64; READING_WORDS] {
    words(prediction, prediction.crosstalk.map_or(-1, |other| other.ranger as i16))
}

fn words(prediction: &Prediction, crosstalk: i16) -> [f64; READING_WORDS] {
    let none = match prediction.status {
        PingStatus::NoEcho => f64::INFINITY,
        _ => f64::NAN,
    };
    let mut head = [0; 8];
    head[0] = status::code(prediction.status);
    head[2..4].copy_from_slice(&crosstalk.to_ne_bytes());
    [
        f64::from_bits(u64::from_ne_bytes(head)),
        prediction.range_m.unwrap_or(none),
        prediction.amplitude.unwrap_or(f64::NAN),
        prediction.margin_db.unwrap_or(f64::NAN),
        prediction.echoes_us.first().copied().unwrap_or(none),
    ]
}

/// Poses, in whatever shape they came.
pub(crate) struct Poses {
    /// One after the other.
    pub(crate) list: Vec<Pose>,
    /// The shape of the array without its last axis.
    pub(crate) shape: Vec<usize>,
}

impl Poses {
    /// Of an array whose last axis is x, y and heading.
    pub(crate) fn of(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (numbers, shape) = rows(given, "poses", 3, "x_m, y_m, heading_deg")?;
        let pose = |row: &[f64]| Pose { x_m: row[0], y_m: row[1], heading_deg: row[2] };
        Ok(Self { list: numbers.chunks_exact(3).map(pose).collect(), shape })
    }

    /// The index of a pose in the array that was given.
    pub(crate) fn index(&self, at: usize) -> Vec<usize> {
        let mut rest = at;
        let mut index: Vec<usize> = Vec::with_capacity(self.shape.len());
        for length in self.shape.iter().rev() {
            index.push(rest % length);
            rest /= length;
        }
        index.reverse();
        index
    }
}

/// The one pose that is meant.
pub(crate) fn one_pose(given: &Bound<'_, PyAny>) -> PyResult<Pose> {
    let poses = Poses::of(given)?;
    match (&*poses.shape, &*poses.list) {
        ([], [pose]) => Ok(*pose),
        (shape, _) => Err(PyValueError::new_err(format!(
            "pose has the shape {:?}: it must be (3,), one pose of x_m, y_m, heading_deg",
            [shape, &[3]].concat()
        ))),
    }
}

/// Points of an array whose last axis is x and y, and the shape of the others.
pub(crate) fn points(given: &Bound<'_, PyAny>, name: &str) -> PyResult<(Vec<DVec2>, Vec<usize>)> {
    let (numbers, shape) = rows(given, name, 2, "x_m, y_m")?;
    let point = |row: &[f64]| DVec2::new(row[0], row[1]);
    Ok((numbers.chunks_exact(2).map(point).collect(), shape))
}

/// The numbers of an array whose last axis has so many, and the shape of the others.
pub(crate) fn rows(
    given: &Bound<'_, PyAny>,
    name: &str,
    columns: usize,
    what: &str,
) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let array: Numbers = given.extract()?;
    let mut shape = array.shape().to_vec();
    if shape.last() != Some(&columns) {
        // A list of nothing has no last axis.
        if shape == [0] {
            return Ok((Vec::new(), shape));
        }
        let shape = PyTuple::new(given.py(), shape)?;
        return Err(PyValueError::new_err(format!(
            "{name} has the shape {shape}: its last axis must be {what}"
        )));
    }
    shape.pop();
    Ok((array.as_array().iter().copied().collect(), shape))
}

/// The numbers of an array, one after the other, and its shape.
pub(crate) fn any(given: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let array: Numbers = given.extract()?;
    Ok((array.as_array().iter().copied().collect(), array.shape().to_vec()))
}

/// Poses as rows of x, y and heading.
pub(crate) fn numbers_of(poses: &[Pose]) -> Vec<f64> {
    poses.iter().flat_map(|pose| [pose.x_m, pose.y_m, pose.heading_deg]).collect()
}

/// The numbers of an array of one axis.
pub(crate) fn list(given: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
    let array: Numbers = given.extract()?;
    if array.ndim() != 1 {
        let shape = PyTuple::new(given.py(), array.shape())?;
        return Err(PyValueError::new_err(format!(
            "{name} has the shape {shape}: it must be (n,)"
        )));
    }
    Ok(array.as_array().iter().copied().collect())
}

/// Numbers as an array of some shape.
pub(crate) fn shaped<'py>(
    py: Python<'py>,
    numbers: Vec<f64>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    PyArray1::from_vec(py, numbers).call_method1("reshape", (PyTuple::new(py, shape)?,))
}
