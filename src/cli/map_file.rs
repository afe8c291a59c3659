//! Maps on disk: the pair that ROS's map_server reads.

use std::{fs, io::Cursor, path::Path};

use super::{
    Failure, Outcome,
    output::{Overwrite, Product, note_input},
};
use crate::interpret::grid::{Grid, MapYaml, from_pgm, from_pixels, to_pgm};

/// A map by its description, or by the folder that holds `map.yaml`.
pub(super) fn read(path: &Path) -> Result<Grid, Failure> {
    let yaml_path = if path.is_dir() { path.join("map.yaml") } else { path.to_path_buf() };
    let refuse = |path: &Path, error: &dyn std::fmt::Display| {
        Failure::input(
            format!("{}: {error}", path.display()),
            "give a map as `sonard map` writes it: map.yaml beside map.pgm (or a PNG)",
        )
    };
    note_input(&yaml_path);
    let text = fs::read_to_string(&yaml_path).map_err(|error| refuse(&yaml_path, &error))?;
    let yaml = MapYaml::from_text(&text).map_err(|error| refuse(&yaml_path, &error))?;
    let image_path = yaml_path.parent().unwrap_or(Path::new("")).join(&yaml.image);
    note_input(&image_path);
    let bytes = fs::read(&image_path).map_err(|error| refuse(&image_path, &error))?;
    match bytes.starts_with(PNG) {
        false => from_pgm(&bytes, &yaml).map_err(|error| refuse(&image_path, &error)),
        true => {
            let (size, pixels) =
                grey(&bytes).map_err(|error| refuse(&image_path, &format!("PNG: {error}")))?;
            from_pixels(size, &pixels, &yaml).map_err(|error| refuse(&image_path, &error))
        }
    }
}

/// What a PNG begins with.
const PNG: &[u8] = b"\x89PNG";
/// The most that an image takes in memory, bytes: as many as a grid has cells, in four colours.
const MOST_BYTES: usize = 1 << 28;
/// What map_server takes for unknown.
const UNKNOWN: u8 = 127;

/// Size and brightness of the pixels of a PNG; those that one sees through are unknown.
fn grey(bytes: &[u8]) -> Result<([usize; 2], Vec<u8>), png::DecodingError> {
    let limits = png::Limits { bytes: MOST_BYTES };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info()?;
    let size = reader.output_buffer_size().filter(|size| *size <= MOST_BYTES);
    let mut image = vec![0; size.ok_or(png::DecodingError::LimitsExceeded)?];
    let frame = reader.next_frame(&mut image)?;
    let channels = frame.color_type.samples();
    let pixel = |samples: &[u8]| match *samples {
        [.., alpha] if matches!(channels, 2 | 4) && alpha < 128 => UNKNOWN,
        [grey] | [grey, _] => grey,
        [r, g, b, ..] => ((u16::from(r) + u16::from(g) + u16::from(b)) / 3) as u8,
        [] => UNKNOWN,
    };
    let pixels = image[..frame.buffer_size()].chunks(channels).map(pixel).collect();
    Ok(([frame.width as usize, frame.height as usize], pixels))
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
