//! Options of models, as keywords.

use pyo3::{
    prelude::*,
    types::{PyBool, PyDict},
};
use serde::de::DeserializeOwned;
use sonard_model::model::{OptionKeys, Options};

use crate::{
    error::{OptionError, refuse},
    json,
};

/// Options that are given as words.
pub(crate) struct Words<'a> {
    pub(crate) engine: &'a str,
    pub(crate) response: Option<&'a str>,
    pub(crate) edge_law: Option<&'a str>,
}

/// Options of keywords.
pub(crate) fn options(py: Python<'_>, words: &Words<'_>, keys: OptionKeys) -> PyResult<Options> {
    let keys = OptionKeys {
        engine: word(py, "engine", words.engine)?,
        response: words.response.map(|name| word(py, "response", name)).transpose()?,
        edge_law: words.edge_law.map(|name| word(py, "edge_law", name)).transpose()?,
        ..keys
    };
    keys.options().map_err(|error| refuse::<OptionError>(py, &error.to_string(), &error.help()))
}

/// The keywords that are given, without the engine.
pub(crate) fn given<'py>(py: Python<'py>, options: &Options) -> PyResult<Bound<'py, PyDict>> {
    let keys = json::to_python(py, &OptionKeys::from(options))?;
    let given = PyDict::new(py);
    for (name, value) in keys.cast::<PyDict>()? {
        let is_given = !value.is_none() && !value.is(PyBool::new(py, false));
        if is_given && name.extract::<String>()? != "engine" {
            given.set_item(name, value)?;
        }
    }
    Ok(given)
}

/// The engine and the keywords given, as a representation ends.
pub(crate) fn shown(py: Python<'_>, options: &Options) -> PyResult<String> {
    let given = given(py, options)?;
    let given = given.iter().map(|(name, value)| {
        Ok(format!(", {}={}", name.extract::<String>()?, value.repr()?.extract::<String>()?))
    });
    let given: String = given.collect::<PyResult<_>>()?;
    Ok(format!("engine '{}'{given}", options.engine.kind().name()))
}

/// A setting that has names for values.
pub(crate) fn word<T: DeserializeOwned>(py: Python<'_>, option: &str, name: &str) -> PyResult<T> {
    serde_json::from_value(name.into())
        .map_err(|error| refuse::<OptionError>(py, &format!("{option} is `{name}`: {error}"), ""))
}
