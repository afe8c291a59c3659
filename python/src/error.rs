//! Python exceptions for the errors of the library, with the same messages.

use std::{io, path::PathBuf};

use pyo3::{
    create_exception,
    exceptions::{PyOSError, PyValueError},
    prelude::*,
    type_object::PyTypeInfo,
};
use sonard_model::{
    acoustics, array, model,
    scene::{self, sanitize},
};

create_exception!(
    sonard,
    SonardError,
    PyValueError,
    "Input rejected by the model. The attribute `help` describes valid input."
);
create_exception!(
    sonard,
    SceneError,
    SonardError,
    "Invalid scene. `line` and `column` (from 1) locate the error in the text, `path` names the value, e.g. \
     `walls[2].to`."
);
create_exception!(
    sonard,
    PoseError,
    SonardError,
    "Pose at which no ranger can be placed. `index` is its index in the given array, a tuple."
);
create_exception!(sonard, SensorError, SonardError, "Invalid sensor data.");
create_exception!(sonard, ArrayError, SonardError, "Invalid data of an array or a course.");
create_exception!(
    sonard,
    AirError,
    SonardError,
    "State of the air outside the range of the formulas."
);
create_exception!(
    sonard,
    OptionError,
    SonardError,
    "Option out of range, or not supported by the engine."
);
create_exception!(
    sonard,
    LogError,
    SonardError,
    "Log that cannot be read or lacks required records."
);
create_exception!(
    sonard,
    TooManyPathsError,
    SonardError,
    "Number of echo paths exceeds the limits of computation and memory."
);

/// Creates an exception with the attribute `help`, a description of valid input.
pub(crate) fn new_error<E: PyTypeInfo>(py: Python<'_>, message: &str, help: &str) -> PyErr {
    let text = if help.is_empty() { message.to_owned() } else { format!("{message}: {help}") };
    let error = PyErr::from_type(E::type_object(py), text);
    set_attribute(py, &error, "help", help);
    error
}

/// Sets an attribute of an exception, ignoring failures.
pub(crate) fn set_attribute<'py, T: IntoPyObject<'py>>(
    py: Python<'py>,
    error: &PyErr,
    name: &str,
    value: T,
) {
    error.value(py).setattr(name, value).ok();
}

/// Converts an error in a scene; line and column are set only if the user passed the text.
pub(crate) fn scene(py: Python<'_>, error: &scene::SceneError, text_is_given: bool) -> PyErr {
    let place = match &*error.path {
        "" => String::new(),
        path => format!("{}: ", sanitize(path)),
    };
    let message =
        if text_is_given { error.to_string() } else { format!("{place}{}", error.message()) };
    let exception = new_error::<SceneError>(py, &message, &error.help());
    let line = text_is_given.then_some(error.line);
    set_attribute(py, &exception, "line", line);
    set_attribute(py, &exception, "column", line.map(|_| error.column));
    set_attribute(py, &exception, "path", sanitize(&error.path));
    exception
}

/// Converts an invalid pose, with its index in the given array.
pub(crate) fn pose(py: Python<'_>, index: &[usize], error: &scene::PoseError) -> PyErr {
    pose_error(py, index, &error.to_string(), &error.help())
}

/// Converts an invalid pose of an array's robot, with its index in the given array.
pub(crate) fn array_pose(py: Python<'_>, index: &[usize], error: &array::ArrayPoseError) -> PyErr {
    pose_error(py, index, &error.to_string(), &error.help())
}

fn pose_error(py: Python<'_>, index: &[usize], text: &str, help: &str) -> PyErr {
    let place = match index {
        [] => String::new(),
        _ => format!("poses{index:?}: "),
    };
    let exception = new_error::<PoseError>(py, &format!("{place}{text}"), help);
    set_attribute(py, &exception, "index", pyo3::types::PyTuple::new(py, index).ok());
    exception
}

/// Converts an error in the data of an array.
pub(crate) fn array(py: Python<'_>, error: &array::ArrayError) -> PyErr {
    new_error::<ArrayError>(py, &error.to_string(), &error.help())
}

/// Converts an error in the data of a sensor.
pub(crate) fn sensor(py: Python<'_>, error: &acoustics::SensorError) -> PyErr {
    let help = match error {
        acoustics::SensorError::Malformed { .. } => {
            "start from a preset (`Sensor.preset(...).to_json()`)"
        }
        acoustics::SensorError::OutOfRange { .. }
        | acoustics::SensorError::UnknownPreset { .. } => "",
    };
    new_error::<SensorError>(py, &error.to_string(), help)
}

/// Converts an error in the parameters of a model.
pub(crate) fn model(py: Python<'_>, error: &model::ModelError) -> PyErr {
    match error {
        model::ModelError::Sensor(error) => sensor(py, error),
        model::ModelError::TooCostly(error) => too_costly(py, error),
        model::ModelError::SensorHeight { .. } => {
            new_error::<SensorError>(py, &error.to_string(), "")
        }
        model::ModelError::Option { .. } => new_error::<OptionError>(py, &error.to_string(), ""),
    }
}

/// Converts an error of a search that exceeds its limits.
pub(crate) fn too_costly(py: Python<'_>, error: &model::TooCostly) -> PyErr {
    new_error::<TooManyPathsError>(py, &error.to_string(), "")
}

/// Converts an error of reading a file, as raised by `open`.
pub(crate) fn unreadable(py: Python<'_>, path: PathBuf, error: &io::Error) -> PyErr {
    match errno_and_text(py, error) {
        Some((number, text)) => PyOSError::new_err((number, text, path.into_os_string())),
        None => PyOSError::new_err(format!("{}: {error}", path.display())),
    }
}

fn errno_and_text(py: Python<'_>, error: &io::Error) -> Option<(i32, String)> {
    let number = error.raw_os_error().or_else(|| match error.kind() {
        // The error number that the library reports without the operating system.
        io::ErrorKind::IsADirectory => {
            py.import("errno").ok()?.getattr("EISDIR").ok()?.extract().ok()
        }
        _ => None,
    })?;
    let text = py.import("os").ok()?.call_method1("strerror", (number,)).ok()?;
    Some((number, text.extract().ok()?))
}
