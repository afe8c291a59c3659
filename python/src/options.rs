//! Options of models, as keyword arguments.

use pyo3::{
    prelude::*,
    types::{PyBool, PyDict},
};
use serde::de::DeserializeOwned;
use sonard_model::model::{OptionKeys, Options};

use crate::{
    error::{OptionError, new_error},
    json,
};

/// Options whose values are names.
pub(crate) struct NamedOptions<'a> {
    pub(crate) engine: &'a str,
    pub(crate) response: Option<&'a str>,
    pub(crate) edge_law: Option<&'a str>,
}

/// Converts keyword arguments to options.
pub(crate) fn options(
    py: Python<'_>,
    named: &NamedOptions<'_>,
    keys: OptionKeys,
) -> PyResult<Options> {
    let keys = OptionKeys {
        engine: parse_name(py, "engine", named.engine)?,
        response: named.response.map(|name| parse_name(py, "response", name)).transpose()?,
        edge_law: named.edge_law.map(|name| parse_name(py, "edge_law", name)).transpose()?,
        ..keys
    };
    keys.options().map_err(|error| new_error::<OptionError>(py, &error.to_string(), &error.help()))
}

/// Returns the options other than the defaults, without the engine.
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

/// Formats the engine and the other options for a representation.
pub(crate) fn sanitize(py: Python<'_>, options: &Options) -> PyResult<String> {
    let given = given(py, options)?;
    let given = given.iter().map(|(name, value)| {
        Ok(format!(", {}={}", name.extract::<String>()?, value.repr()?.extract::<String>()?))
    });
    let given: String = given.collect::<PyResult<_>>()?;
    Ok(format!("engine '{}'{given}", options.engine.kind().name()))
}

/// Parses the name of an option's value.
pub(crate) fn parse_name<T: DeserializeOwned>(
    py: Python<'_>,
    option: &str,
    name: &str,
) -> PyResult<T> {
    serde_json::from_value(name.into()).map_err(|error| {
        new_error::<OptionError>(py, &format!("{option} is `{name}`: {error}"), "")
    })
}
