//! Data sets.

use std::path::PathBuf;

use pyo3::{prelude::*, types::PyDict};
use sonard::{
    dataset::{DataSet, DataSetError},
    generate::{Part, Table},
};

use crate::{
    error::{SonardError, refuse, unreadable},
    pool::pool,
};

/// Makes the data set of a specification, or a part of it, as ``sonard generate`` does: shards that are there are left
/// out, and the bytes of others are the same whoever makes them.
///
/// Parameters
/// ----------
/// spec : path
///     The specification, TOML, or ``spec.json`` of a set.
/// out : path
///     Folder of the set.
/// part : tuple of int, optional
///     ``(i, n)``: every n-th shard from the i-th on, i from 1; without it all.
/// threads : int, optional
///     Shards at once; without it as many as there are cores.
///
/// Returns
/// -------
/// dict
///     ``made``, ``were_there``: shards; ``sha256``, ``readings``, ``bytes`` of the set, or ``None`` while shards are
///     missing.
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
    let part =
        Part::new(number, of).map_err(|error| refuse::<SonardError>(py, &error.to_string(), ""))?;
    let pool = pool(py, threads)?;
    let made = py.detach(move || {
        let generator = DataSet::read_specification(&spec, &|_| {})?;
        let set = DataSet::open(&out, &generator)?;
        let made = pool.install(|| set.make_part(part, &|_| {}))?;
        Ok((made, set.seal()?))
    });
    let (made, whole) = made.map_err(|error| refused(py, error))?;
    let told = PyDict::new(py);
    told.set_item("made", made.made)?;
    told.set_item("were_there", made.were_there)?;
    let totals = whole.as_ref().map(|manifest| &manifest.totals);
    told.set_item("sha256", whole.as_ref().map(|manifest| &*manifest.sha256))?;
    told.set_item("readings", totals.map(|totals| totals.rows.get(&Table::Readings)))?;
    told.set_item("bytes", totals.map(|totals| totals.bytes))?;
    Ok(told)
}

fn refused(py: Python<'_>, error: DataSetError) -> PyErr {
    match error {
        DataSetError::Io { path, source, .. } => unreadable(py, path, &source),
        error => refuse::<SonardError>(py, &error.to_string(), &error.help()),
    }
}
