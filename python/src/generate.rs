//! Generation of data sets.

use std::path::PathBuf;

use pyo3::{prelude::*, types::PyDict};
use sonard::{
    dataset::{DataSet, DataSetError},
    generate::{SetPart, ShardTable},
};

use crate::{
    error::{SonardError, new_error, unreadable},
    pool::pool,
};

/// Generates the data set of a specification, or a part of it, as ``sonard generate`` does.
/// Existing shards are kept. The bytes of a shard do not depend on the program that generates it.
///
/// Parameters
/// ----------
/// spec : path
///     The specification, TOML, or ``spec.json`` of a set.
///     Specification, TOML, or ``spec.json`` of a data set.
///     Folder of the set.
///     Folder of the data set.
///     ``(i, n)``: every n-th shard from the i-th on, i from 1. Defaults to all shards.
///     Shards generated simultaneously. Defaults to the number of cores.
///
/// Returns
/// -------
/// dict
///     ``generated`` and ``existed``: numbers of shards; ``sha256``, ``readings``, ``bytes`` of the
///     data set, or ``None`` while shards are missing.
#[pyfunction]
#[pyo3(signature = (spec, out, *, part = None, threads = None))]
pub(crate) fn generate<'py>(
    py: Python<'py>,
    spec: PathBuf,
    out: PathBuf,
    part: Option<(u32, u32)>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyDict>> {
    let (number, of) = part.unwrap_or((1, 1));
    let part = SetPart::new(number, of)
        .map_err(|error| new_error::<SonardError>(py, &error.to_string(), ""))?;
    let pool = pool(py, threads)?;
    let made = py.detach(move || {
        let generator = DataSet::read_specification(&spec, &|_| {})?;
        let set = DataSet::open(&out, &generator)?;
        let made = pool.install(|| set.generate_part(part, &|_| {}))?;
        Ok((made, set.write_manifest()?))
    });
    let (made, whole) = made.map_err(|error| to_exception(py, error))?;
    let summary = PyDict::new(py);
    summary.set_item("generated", made.generated)?;
    summary.set_item("existed", made.existed)?;
    let totals = whole.as_ref().map(|manifest| &manifest.totals);
    summary.set_item("sha256", whole.as_ref().map(|manifest| &*manifest.sha256))?;
    summary.set_item("readings", totals.map(|totals| totals.rows.get(&ShardTable::Readings)))?;
    summary.set_item("bytes", totals.map(|totals| totals.bytes))?;
    Ok(summary)
}

fn to_exception(py: Python<'_>, error: DataSetError) -> PyErr {
    match error {
        DataSetError::Io { path, source, .. } => unreadable(py, path, &source),
        error => new_error::<SonardError>(py, &error.to_string(), &error.help()),
    }
}
