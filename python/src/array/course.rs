//! Python class for the trajectory of a robot.

use std::{fs, path::PathBuf};

use pyo3::{exceptions::PyValueError, prelude::*};
use sonard_model::array;

use crate::{
    arrays::{self, PoseArray},
    error::{self, ArrayError, new_error},
};

/// Trajectory of a robot: a sequence of poses, connected by straight lines, with uniform rotation
/// through the smaller angle.
///
/// Parameters
/// ----------
/// poses : array_like, shape (n, 3)
///     x and y in metres, heading in degrees counter-clockwise from +x.
/// times_s : array_like, shape (n,), optional
///     Times of the poses, seconds, increasing; counted from the first.
/// speed_m_s : float
///     Speed without given times, metres per second, 0.001 to 10; the robot turns at 60 degrees per
///     second.
#[pyclass(frozen, module = "sonard")]
pub(crate) struct Course {
    course: array::RobotCourse,
}

/// Minimum and maximum speed, metres per second, as for the daemon.
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
        let PoseArray { list, shape } = PoseArray::from_python(poses)?;
        if shape.len() != 1 {
            let message = format!("poses has {} axes: it must be of shape (n, 3)", shape.len() + 1);
            return Err(PyValueError::new_err(message));
        }
        let times_s = times_s.map(|given| arrays::list(given, "times_s")).transpose()?;
        let course = array::RobotCourse::new(&list, times_s.as_deref()).map_err(|error| {
            let message = format!("poses[{}]: {}", error.line - 1, error.message);
            new_error::<ArrayError>(py, &message, "")
        })?;
        Ok(Self { course: course.with_times(checked_speed(speed_m_s)?) })
    }

    /// Reads a trajectory from a file with a line {"x_m": 1.0, "y_m": 2.0, "heading_deg": 90.0} for
    /// each pose, with or without "time_s", as for the daemon.
    #[staticmethod]
    #[pyo3(signature = (path, speed_m_s = 0.3))]
    fn load(py: Python<'_>, path: PathBuf, speed_m_s: f64) -> PyResult<Self> {
        let name = path.display().to_string();
        let text =
            fs::read_to_string(&path).map_err(|error| error::unreadable(py, path, &error))?;
        let course = array::RobotCourse::from_json_lines(&text).map_err(|error| {
            let message = format!("{name}:{}: {}", error.line, error.message);
            new_error::<ArrayError>(py, &message, "")
        })?;
        Ok(Self { course: course.with_times(checked_speed(speed_m_s)?) })
    }

    /// Poses of the trajectory: array of shape (n, 3) of x and y (metres) and heading (degrees).
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let poses = self.course.poses();
        arrays::shaped(py, arrays::numbers_of(poses), &[poses.len(), 3])
    }

    /// Times of the poses, seconds after the first: shape (n,).
    #[getter]
    fn times_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let times_s = self.course.times_s();
        arrays::shaped(py, times_s.to_vec(), &[times_s.len()])
    }

    /// Duration of the trajectory, seconds.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.course.duration_s()
    }

    /// Interpolates the pose at the given times; before the start the first pose, after the end the
    /// last.
    ///
    /// Parameters
    /// ----------
    /// times_s : array_like, shape (...)
    ///     Times, seconds after the first pose.
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
        let (times_s, shape) = arrays::flattened(times_s)?;
        if let Some(at) = times_s.iter().position(|time_s| time_s.is_nan()) {
            let message = format!("times_s[{at}] is nan");
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
    let [min, max] = SPEEDS_M_S;
    if (min..=max).contains(&speed_m_s) {
        return Ok(speed_m_s);
    }
    let message = format!("speed_m_s is {speed_m_s}: it must be from {min} to {max}");
    Err(PyValueError::new_err(message))
}
