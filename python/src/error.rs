//! Errors of the library as exceptions, with the same words.

use std::{io, path::PathBuf};

use pyo3::{
    create_exception,
    exceptions::{PyOSError, PyValueError},
    prelude::*,
    type_object::PyTypeInfo,
};
use sonard_model::{
    acoustics, array, model,
    scene::{self, shown},
};

create_exception!(
    sonard,
    SonardError,
    PyValueError,
    "What the model refuses. The attribute `help` says what would be right."
);
create_exception!(
    sonard,
    SceneError,
    SonardError,
    "A scene that can't be used. `line` and `column` (from 1) say where in its text, `path` which value, as \
     `walls[2].to`."
);
create_exception!(
    sonard,
    PoseError,
    SonardError,
    "A pose at which no ranger can stand. `index` is its place among those given, a tuple."
);
create_exception!(sonard, SensorError, SonardError, "A sensor's data that make no sense.");
create_exception!(
    sonard,
    ArrayError,
    SonardError,
    "An array's or a course's data that make no sense."
);
create_exception!(sonard, AirError, SonardError, "Air that the formulas do not cover.");
create_exception!(
    sonard,
    OptionError,
    SonardError,
    "An option out of range, or one that the engine does not know."
);
create_exception!(
    sonard,
    LogError,
    SonardError,
    "A log that can't be read, or that lacks what is asked of it."
);
create_exception!(
    sonard,
    TooManyPathsError,
    SonardError,
    "More echo paths than can be found within bounds of work and memory."
);

/// An exception with what would be right.
pub(crate) fn refuse<E: PyTypeInfo>(py: Python<'_>, message: &str, help: &str) -> PyErr {
    let words = if help.is_empty() { message.to_owned() } else { format!("{message}: {help}") };
    let error = PyErr::from_type(E::type_object(py), words);
    tell(py, &error, "help", help);
    error
}

/// Sets an attribute of an exception; one that can't be set is left out.
pub(crate) fn tell<'py, T: IntoPyObject<'py>>(
    py: Python<'py>,
    error: &PyErr,
    name: &str,
    value: T,
) {
    error.value(py).setattr(name, value).ok();
}

/// A fault of a scene, with its place in the text where the user wrote that.
pub(crate) fn scene(py: Python<'_>, error: &scene::SceneError, text_is_given: bool) -> PyErr {
    let place = match &*error.path {
        "" => String::new(),
        path => format!("{}: ", shown(path)),
    };
    let message =
        if text_is_given { error.to_string() } else { format!("{place}{}", error.message()) };
    let exception = refuse::<SceneError>(py, &message, &error.help());
    let line = text_is_given.then_some(error.line);
    tell(py, &exception, "line", line);
    tell(py, &exception, "column", line.map(|_| error.column));
    tell(py, &exception, "path", shown(&error.path));
    exception
}

/// A pose that is refused, by its place among those given.
pub(crate) fn pose(py: Python<'_>, index: &[usize], error: &scene::PoseError) -> PyErr {
    pose_in_words(py, index, &error.to_string(), &error.help())
}

/// A pose of an array's robot that is refused, likewise.
pub(crate) fn array_pose(py: Python<'_>, index: &[usize], error: &array::ArrayPoseError) -> PyErr {
    pose_in_words(py, index, &error.to_string(), &error.help())
}

fn pose_in_words(py: Python<'_>, index: &[usize], words: &str, help: &str) -> PyErr {
    let place = match index {
        [] => String::new(),
        _ => format!("poses{index:?}: "),
    };
    let exception = refuse::<PoseError>(py, &format!("{place}{words}"), help);
    tell(py, &exception, "index", pyo3::types::PyTuple::new(py, index).ok());
    exception
}

/// Data of an array that are refused.
pub(crate) fn array(py: Python<'_>, error: &array::ArrayError) -> PyErr {
    refuse::<ArrayError>(py, &error.to_string(), &error.help())
}

/// Data of a sensor that are refused.
pub(crate) fn sensor(py: Python<'_>, error: &acoustics::SensorError) -> PyErr {
    let help = match error {
        acoustics::SensorError::Form { .. } => {
            "start from a preset (`Sensor.preset(...).to_json()`)"
        }
        acoustics::SensorError::Figure { .. } | acoustics::SensorError::UnknownPreset { .. } => "",
    };
    refuse::<SensorError>(py, &error.to_string(), help)
}

/// A model that can't be made.
pub(crate) fn model(py: Python<'_>, error: &model::ModelError) -> PyErr {
    match error {
        model::ModelError::Sensor(error) => sensor(py, error),
        model::ModelError::TooCostly(error) => too_costly(py, error),
        model::ModelError::SensorHeight { .. } => refuse::<SensorError>(py, &error.to_string(), ""),
        model::ModelError::Option { .. } => refuse::<OptionError>(py, &error.to_string(), ""),
    }
}

/// A search that would cost too much.
pub(crate) fn too_costly(py: Python<'_>, error: &model::TooCostly) -> PyErr {
    refuse::<TooManyPathsError>(py, &error.to_string(), "")
}

/// A file that can't be read, as `open` would say it.
pub(crate) fn unreadable(py: Python<'_>, path: PathBuf, error: &io::Error) -> PyErr {
    match number_and_words(py, error) {
        Some((number, words)) => PyOSError::new_err((number, words, path.into_os_string())),
        None => PyOSError::new_err(format!("{}: {error}", path.display())),
    }
}

fn number_and_words(py: Python<'_>, error: &io::Error) -> Option<(i32, String)> {
    let number = error.raw_os_error().or_else(|| match error.kind() {
        // The library says this one by itself.
        io::ErrorKind::IsADirectory => {
            py.import("errno").ok()?.getattr("EISDIR").ok()?.extract().ok()
        }
        _ => None,
    })?;
    let words = py.import("os").ok()?.call_method1("strerror", (number,)).ok()?;
    Some((number, words.extract().ok()?))
}
