//! Between Python's objects and JSON.

use pyo3::prelude::*;
use serde::Serialize;

use crate::error::{SonardError, refuse};

/// A value as dicts, lists and numbers.
pub(crate) fn to_python<'py>(
    py: Python<'py>,
    value: &impl Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value)
        .map_err(|error| refuse::<SonardError>(py, &error.to_string(), ""))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// Dicts, lists and numbers as the text of a JSON document.
pub(crate) fn text_of(value: &Bound<'_, PyAny>) -> PyResult<String> {
    value.py().import("json")?.call_method1("dumps", (value,))?.extract()
}
