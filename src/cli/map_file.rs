//! Maps on disk: the pair that ROS's map_server reads.

use std::{fs, path::Path};

use super::{Failure, Outcome, files::save};
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
    let text = fs::read_to_string(&yaml_path).map_err(|error| refuse(&yaml_path, &error))?;
    let yaml = MapYaml::from_text(&text).map_err(|error| refuse(&yaml_path, &error))?;
    let image_path = yaml_path.parent().unwrap_or(Path::new("")).join(&yaml.image);
    let bytes = fs::read(&image_path).map_err(|error| refuse(&image_path, &error))?;
    from_pgm(&bytes, &yaml).map_err(|error| refuse(&image_path, &error))
}

/// Writes `map.pgm` and `map.yaml` into a folder.
pub(super) fn write(folder: &Path, grid: &Grid) -> Outcome {
    save(&folder.join("map.pgm"), &to_pgm(grid))?;
    save(&folder.join("map.yaml"), MapYaml::of(grid.shape(), "map.pgm").to_text().as_bytes())
}
