//! Maps on disk in the format of ROS's map_server.

use std::path::Path;

use super::{
    Failure, Outcome,
    output::{Overwrite, Product, register_input},
};
use crate::{
    grid_file,
    interpret::grid::{Grid, MapYaml, to_pgm},
    scene::Surfaces,
};

/// Reads a map from its description, or from a folder with `map.yaml`.
pub(super) fn read(path: &Path) -> Result<Grid, Failure> {
    grid_file::read(path, register_input).map_err(|error| Failure::input(&error, error.help()))
}

/// Traces the walls of a map as surfaces; lengths are metres. Returns them with the map's
/// description.
pub(super) fn read_walls(
    path: &Path,
    tolerance_m: Option<f64>,
    min_length_m: Option<f64>,
) -> Result<(Surfaces, MapYaml), Failure> {
    grid_file::read_walls(path, tolerance_m, min_length_m, register_input)
        .map_err(|error| Failure::input(&error, error.help()))
}

/// Registers the files of a map as inputs.
pub(super) fn register_inputs(path: &Path) {
    for name in ["map.yaml", "map.pgm"] {
        register_input(&path.join(name));
        register_input(&path.with_file_name(name));
    }
}

/// Files written by [`write`].
const FILES: [(&str, Product); 2] = [("map.pgm", Product::Pgm), ("map.yaml", Product::MapYaml)];

/// Checks that a map may be written into a folder.
pub(super) fn check(folder: &Path, overwrite: Overwrite) -> Outcome {
    FILES.iter().try_for_each(|(name, product)| overwrite.check_in(folder, name, *product))
}

/// Writes `map.pgm` and `map.yaml` into a folder.
pub(super) fn write(folder: &Path, grid: &Grid, overwrite: Overwrite) -> Outcome {
    let yaml = MapYaml::new(grid.shape(), "map.pgm").to_text();
    let texts = [to_pgm(grid), yaml.into_bytes()];
    FILES.iter().zip(&texts).try_for_each(|((name, product), bytes)| {
        overwrite.save(&folder.join(name), *product, bytes)
    })
}
