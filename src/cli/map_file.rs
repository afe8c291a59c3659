//! Maps on disk: the pair that ROS's map_server reads.

use std::{fs, path::Path};

use super::{
    Failure, Outcome,
    output::{Overwrite, Product, note_input},
};
use crate::interpret::grid::{Grid, MapYaml, from_pgm, to_pgm};

/// A map by its description, or by the folder that holds `map.yaml`.
pub(super) fn read(path: &Path) -> Result<Grid, Failure> {
    let yaml_path = if path.is_dir() { path.join("map.yaml") } else { path.to_path_buf() };
    let refuse = |path: &Path, error: &dyn std::fmt::Display| {
        Failure::input(
            format!("{}: {error}", path.display()),
            "give a map as `sonard map` writes it: map.yaml beside map.pgm",
        )
    };
    note_input(&yaml_path);
    let text = fs::read_to_string(&yaml_path).map_err(|error| refuse(&yaml_path, &error))?;
    let yaml = MapYaml::from_text(&text).map_err(|error| refuse(&yaml_path, &error))?;
    let image_path = yaml_path.parent().unwrap_or(Path::new("")).join(&yaml.image);
    note_input(&image_path);
    let bytes = fs::read(&image_path).map_err(|error| refuse(&image_path, &error))?;
    from_pgm(&bytes, &yaml).map_err(|error| refuse(&image_path, &error))
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
