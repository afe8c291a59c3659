//! Conversion of NumPy arrays: poses, points, azimuths, readings.

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

/// Argument that can be converted to an array of numbers.
pub(crate) type Numbers<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// Size of a reading in words of eight bytes: status with seven bytes of padding, and four numbers.
pub(crate) const READING_WORDS: usize = 5;

/// Fields of a reading: name, format and offset in bytes.
const FIELDS: [(&str, &str, usize); READING_WORDS] = [
    ("status", "u1", 0),
    ("range_m", "f8", 8),
    ("amplitude", "f8", 16),
    ("margin_db", "f8", 24),
    ("tof_us", "f8", 32),
];

/// Additional field of the readings of arrays, in the padding.
const CROSSTALK: (&str, &str, usize) = ("crosstalk", "i2", 2);

/// NumPy dtype of a reading.
pub(crate) fn reading_dtype(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    dtype(py, &FIELDS, 8 * READING_WORDS)
}

/// NumPy dtype of a reading of an array of rangers.
pub(crate) fn array_reading_dtype(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let mut fields = FIELDS.to_vec();
    fields.insert(1, CROSSTALK);
    dtype(py, &fields, 8 * READING_WORDS)
}

/// NumPy dtype of a structure with the given fields: name, format and offset.
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

/// Encodes a reading in the words of its array. Without an echo, range and time of flight are
/// infinite; missing values are not a number.
pub(crate) fn encode_reading(prediction: &Prediction) -> [f64; READING_WORDS] {
    encode(prediction, 0)
}

/// Encodes a reading of an array, with the index of the ranger that transmitted the detected sound,
/// or -1 for the ranger's own.
pub(crate) fn encode_array_reading(prediction: &Prediction) -> [f64; READING_WORDS] {
    encode(prediction, prediction.crosstalk.map_or(-1, |other| other.ranger as i16))
}

fn encode(prediction: &Prediction, crosstalk: i16) -> [f64; READING_WORDS] {
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

/// Poses from an array of any shape.
pub(crate) struct PoseArray {
    /// Poses in row-major order.
    pub(crate) list: Vec<Pose>,
    /// Shape of the array without its last axis.
    pub(crate) shape: Vec<usize>,
}

impl PoseArray {
    /// Converts an array whose last axis is x, y and heading.
    pub(crate) fn from_python(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (numbers, shape) = rows(given, "poses", 3, "x_m, y_m, heading_deg")?;
        let pose = |row: &[f64]| Pose { x_m: row[0], y_m: row[1], heading_deg: row[2] };
        Ok(Self { list: numbers.chunks_exact(3).map(pose).collect(), shape })
    }

    /// Index of pose number `at` in the given array.
    pub(crate) fn index(&self, at: usize) -> Vec<usize> {
        let mut remaining = at;
        let mut index: Vec<usize> = Vec::with_capacity(self.shape.len());
        for length in self.shape.iter().rev() {
            index.push(remaining % length);
            remaining /= length;
        }
        index.reverse();
        index
    }
}

/// Converts an array that must contain a single pose.
pub(crate) fn one_pose(given: &Bound<'_, PyAny>) -> PyResult<Pose> {
    let poses = PoseArray::from_python(given)?;
    match (&*poses.shape, &*poses.list) {
        ([], [pose]) => Ok(*pose),
        (shape, _) => Err(PyValueError::new_err(format!(
            "pose has the shape {:?}: it must be (3,), one pose of x_m, y_m, heading_deg",
            [shape, &[3]].concat()
        ))),
    }
}

/// Converts an array whose last axis is x and y; returns the points and the shape of the other
/// axes.
pub(crate) fn points(given: &Bound<'_, PyAny>, name: &str) -> PyResult<(Vec<DVec2>, Vec<usize>)> {
    let (numbers, shape) = rows(given, name, 2, "x_m, y_m")?;
    let point = |row: &[f64]| DVec2::new(row[0], row[1]);
    Ok((numbers.chunks_exact(2).map(point).collect(), shape))
}

/// Converts an array whose last axis has `columns` elements; returns the numbers and the shape of
/// the other axes.
pub(crate) fn rows(
    given: &Bound<'_, PyAny>,
    name: &str,
    columns: usize,
    columns_text: &str,
) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let array: Numbers = given.extract()?;
    let mut shape = array.shape().to_vec();
    if shape.last() != Some(&columns) {
        // An empty list has no last axis.
        if shape == [0] {
            return Ok((Vec::new(), shape));
        }
        let shape = PyTuple::new(given.py(), shape)?;
        return Err(PyValueError::new_err(format!(
            "{name} has the shape {shape}: its last axis must be {columns_text}"
        )));
    }
    shape.pop();
    Ok((array.as_array().iter().copied().collect(), shape))
}

/// Converts an array of any shape; returns the numbers in row-major order and the shape.
pub(crate) fn flattened(given: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let array: Numbers = given.extract()?;
    Ok((array.as_array().iter().copied().collect(), array.shape().to_vec()))
}

/// Rows of x, y and heading.
pub(crate) fn numbers_of(poses: &[Pose]) -> Vec<f64> {
    poses.iter().flat_map(|pose| [pose.x_m, pose.y_m, pose.heading_deg]).collect()
}

/// Converts an array with a single axis.
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

/// Creates an array of the given shape.
pub(crate) fn shaped<'py>(
    py: Python<'py>,
    numbers: Vec<f64>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    PyArray1::from_vec(py, numbers).call_method1("reshape", (PyTuple::new(py, shape)?,))
}
