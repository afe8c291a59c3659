//! Maps on disk: the pair that ROS's map_server reads.

use std::path::Path;

use super::{
    Failure, Outcome,
    output::{Overwrite, Product, note_input},
};
use crate::{
    grid_file,
    interpret::grid::{Grid, MapYaml, to_pgm},
    scene::Surfaces,
};

/// A map by its description, or by the folder that holds `map.yaml`.
pub(super) fn read(path: &Path) -> Result<Grid, Failure> {
    grid_file::read(path, note_input).map_err(|error| Failure::input(&error, error.help()))
}

/// Walls of a map as surfaces, with its description; lengths are metres.
pub(super) fn read_walls(
    path: &Path,
    tolerance_m: Option<f64>,
    least_m: Option<f64>,
) -> Result<(Surfaces, MapYaml), Failure> {
    grid_file::read_walls(path, tolerance_m, least_m, note_input)
        .map_err(|error| Failure::input(&error, error.help()))
}

/// Notes that the command reads a map, before it does.
pub(super) fn note(path: &Path) {
    for name in ["map.yaml", "map.pgm"] {
        note_input(&path.join(name));
        note_input(&path.with_file_name(name));
    }
}

/// What [`write`] writes.
const FILES: [(&str, Product); 2] = [("map.pgm", Product::Pgm), ("map.yaml", Product::MapYaml)];

/// Checks that a map may be written into a folder.
pub(super) fn check(folder: &Path, overwrite: Overwrite) -> Outcome {
    FILES.iter().try_for_each(|(name, product)| overwrite.check_in(folder, name, *product))
}

/// Writes `map.pgm` and `map.yaml` into a folder.
pub(super) fn write(folder: &Path, grid: &Grid, overwrite: Overwrite) -> Outcome {
    let yaml = MapYaml::of(grid.shape(), "map.pgm").to_text();
    let texts = [to_pgm(grid), yaml.into_bytes()];
    FILES.iter().zip(&texts).try_for_each(|((name, product), bytes)| {
        overwrite.save(&folder.join(name), *product, bytes)
    })
}
