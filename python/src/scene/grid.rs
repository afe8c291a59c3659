//! Scenes from maps of ROS's map_server.

use std::path::Path;

use pyo3::prelude::*;
use sonard::grid_file::{self, GridFileError, GridFileFault};
use sonard_model::scene;

use super::check_range;
use crate::error::{self, SceneError, new_error};

pub(super) fn traced(
    py: Python<'_>,
    path: &Path,
    tolerance_m: Option<f64>,
    min_length_m: Option<f64>,
    reflectance: f64,
    name: Option<&str>,
) -> PyResult<scene::Scene> {
    for (name, value) in [("tolerance_m", tolerance_m), ("min_length_m", min_length_m)] {
        check_range(name, value.unwrap_or_default(), [0.0, 1e6])?;
    }
    let found = py.detach(|| grid_file::read_walls(path, tolerance_m, min_length_m, |_| {}));
    let (found, _) = found.map_err(|error| to_exception(py, &error))?;
    if found.is_empty() {
        let help = "use a map with occupied cells (above 0.65) next to free ones, or a smaller min_length_m";
        let message = format!("{}: the map contains no wall", path.display());
        return Err(new_error::<SceneError>(py, &message, help));
    }
    let stem = path.file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default();
    let name = name.unwrap_or(&stem);
    let scene = found.scene(if name.is_empty() { "scene" } else { name }, reflectance).build();
    scene.map_err(|error| error::scene(py, &error, false))
}

fn to_exception(py: Python<'_>, error: &GridFileError) -> PyErr {
    match &error.fault {
        GridFileFault::Disk(source) | GridFileFault::Image(source) => {
            error::unreadable(py, error.path.clone(), source)
        }
        GridFileFault::IsImage
        | GridFileFault::Map(_)
        | GridFileFault::Png(_)
        | GridFileFault::Rotated(_) => {
            new_error::<SceneError>(py, &error.to_string(), error.help())
        }
    }
}
