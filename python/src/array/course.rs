//! The courses of robots.

use std::{fs, path::PathBuf};

use pyo3::{exceptions::PyValueError, prelude::*};
use sonard_model::array;

use crate::{
    arrays::{self, Poses},
    error::{self, ArrayError, refuse},
};

/// The course that a robot drives: poses one after the other, on straight lines between them, turning evenly the
/// shorter way.
///
/// Parameters
/// ----------
/// poses : array_like, shape (n, 3)
///     x and y in metres, heading in degrees counter-clockwise from +x.
/// times_s : array_like, shape (n,), optional
///     When the robot is at each of them, seconds, growing; counted from the first.
/// speed_m_s : float
///     How fast it drives where there are no times, metres a second, 0.001 to 10; it turns 60 degrees a second.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Course {
    course: array::Course,
}

/// Slowest and fastest drive, metres a second, as of the daemon.
const SPEEDS_M_S: [f64; 2] = [0.001, 10.0];

#[pymethods]
impl Course {
    #[new]
    #[pyo3(signature = (poses, times_s = None, speed_m_s = 0.3))]
    fn new(
        poses: &Bound<'_, PyAny>,
        times_s: Option<&Bound<'_, PyAny>>,
        speed_m_s: f64,
    ) -> PyResult<Self> {
        let py = poses.py();
        let Poses { list, shape } = Poses::of(poses)?;
        if shape.len() != 1 {
            let message = format!("poses has {} axes: it must be of shape (n, 3)", shape.len() + 1);
            return Err(PyValueError::new_err(message));
        }
        let times_s = times_s.map(|given| arrays::list(given, "times_s")).transpose()?;
        let course = array::Course::new(&list, times_s.as_deref()).map_err(|error| {
            let message = format!("poses[{}]: {}", error.line - 1, error.message);
            refuse::<ArrayError>(py, &message, "")
        })?;
        Ok(Self { course: course.timed(checked_speed(speed_m_s)?) })
    }

    /// A course from a file with a line {"x_m": 1.0, "y_m": 2.0, "heading_deg": 90.0} for each pose, with or without
    /// "time_s", as the daemon takes it.
    #[staticmethod]
    #[pyo3(signature = (path, speed_m_s = 0.3))]
    fn load(py: Python<'_>, path: PathBuf, speed_m_s: f64) -> PyResult<Self> {
        let name = path.display().to_string();
        let text =
            fs::read_to_string(&path).map_err(|error| error::unreadable(py, path, &error))?;
        let course = array::Course::from_json_lines(&text).map_err(|error| {
            let message = format!("{name}:{}: {}", error.line, error.message);
            refuse::<ArrayError>(py, &message, "")
        })?;
        Ok(Self { course: course.timed(checked_speed(speed_m_s)?) })
    }

    /// Its poses: array of shape (n, 3) of x and y (metres) and heading (degrees).
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let poses = self.course.poses();
        arrays::shaped(py, arrays::numbers_of(poses), &[poses.len(), 3])
    }

    /// When the robot is at each of them, seconds after the first: shape (n,).
    #[getter]
    fn times_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let times_s = self.course.times_s();
        arrays::shaped(py, times_s.to_vec(), &[times_s.len()])
    }

    /// How long it takes, seconds.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.course.duration_s()
    }

    /// Where the robot is at some times: before the first pose at it, in the end at the last.
    ///
    /// Parameters
    /// ----------
    /// times_s : array_like, shape (...)
    ///     Seconds after the first pose.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (..., 3)
    ///     x and y (metres) and heading (degrees).
    fn poses_at<'py>(
        &self,
        py: Python<'py>,
        times_s: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (times_s, shape) = arrays::any(times_s)?;
        if let Some(at) = times_s.iter().position(|time_s| time_s.is_nan()) {
            let message = format!("times_s has a nan, its {}th number", at + 1);
            return Err(PyValueError::new_err(message));
        }
        let poses: Vec<_> = times_s.iter().map(|time_s| self.course.pose_at(*time_s)).collect();
        arrays::shaped(py, arrays::numbers_of(&poses), &[&*shape, &[3]].concat())
    }

    fn __repr__(&self) -> String {
        let count = self.course.poses().len();
        format!("<Course of {count} poses in {:.1} s>", self.course.duration_s())
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.course == other.get().course)
    }

    fn __len__(&self) -> usize {
        self.course.poses().len()
    }

    fn __getnewargs__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        Ok((self.poses(py)?, self.times_s(py)?))
    }
}

fn checked_speed(speed_m_s: f64) -> PyResult<f64> {
    let [least, most] = SPEEDS_M_S;
    if (least..=most).contains(&speed_m_s) {
        return Ok(speed_m_s);
    }
    let message = format!("speed_m_s is {speed_m_s}: it must be from {least} to {most}");
    Err(PyValueError::new_err(message))
}
