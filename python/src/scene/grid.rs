//! Scenes from maps of ROS's map_server.

use std::path::Path;

use pyo3::prelude::*;
use sonard::grid_file::{self, GridFileError, GridFileFault};
use sonard_model::scene;

use super::between;
use crate::error::{self, SceneError, refuse};

pub(super) fn traced(
    py: Python<'_>,
    path: &Path,
    tolerance_m: Option<f64>,
    least_m: Option<f64>,
    reflectance: f64,
    name: Option<&str>,
) -> PyResult<scene::Scene> {
    for (name, value) in [("tolerance_m", tolerance_m), ("least_m", least_m)] {
        between(name, value.unwrap_or_default(), [0.0, 1e6])?;
    }
    let found = py.detach(|| grid_file::read_walls(path, tolerance_m, least_m, |_| {}));
    let (found, _) = found.map_err(|error| unusable(py, &error))?;
    if found.is_empty() {
        let help =
            "give a map with occupied cells (above 0.65) beside free ones, or a smaller least_m";
        let message = format!("{}: no wall is found in it", path.display());
        return Err(refuse::<SceneError>(py, &message, help));
    }
    let stem = path.file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default();
    let name = name.unwrap_or(&stem);
    let built = found.scene(if name.is_empty() { "scene" } else { name }, reflectance).build();
    built.map_err(|error| error::scene(py, &error, false))
}

fn unusable(py: Python<'_>, error: &GridFileError) -> PyErr {
    match &error.fault {
        GridFileFault::Disk(source) | GridFileFault::Image(source) => {
            error::unreadable(py, error.path.clone(), source)
        }
        GridFileFault::IsImage
        | GridFileFault::Map(_)
        | GridFileFault::Png(_)
        | GridFileFault::Turned(_) => refuse::<SceneError>(py, &error.to_string(), error.help()),
    }
}
