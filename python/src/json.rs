//! Conversion between Python objects and JSON.

use pyo3::prelude::*;
use serde::Serialize;

use crate::error::{SonardError, new_error};

/// Converts a value to dicts, lists and numbers.
pub(crate) fn to_python<'py>(
    py: Python<'py>,
    value: &impl Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value)
        .map_err(|error| new_error::<SonardError>(py, &error.to_string(), ""))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// Converts dicts, lists and numbers to the text of a JSON document.
pub(crate) fn to_text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    value.py().import("json")?.call_method1("dumps", (value,))?.extract()
}
