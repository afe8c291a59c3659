//! Occupancy grids on disk, as ROS's map_server has them: a description (YAML), and beside it an image, PGM or PNG.

use std::{
    fs,
    io::{self, Cursor},
    path::{Path, PathBuf},
};

use thiserror::Error;

use crate::interpret::grid::{Grid, ImageError, MapYaml, from_pgm, from_pixels};

/// A file of a map that can't be used.
#[derive(Debug, Error)]
#[error("{}: {fault}", path.display())]
pub struct GridFileError {
    /// Which file.
    pub path: PathBuf,
    /// What is wrong with it.
    #[source]
    pub fault: GridFileFault,
}

/// An error in a map file.
#[derive(Debug, Error)]
pub enum GridFileFault {
    /// The disk does not give it.
    #[error(transparent)]
    Disk(#[from] io::Error),
    /// It is no description or image of a map.
    #[error(transparent)]
    Map(#[from] ImageError),
    /// It is no PNG, or too large a one.
    #[error("PNG: {0}")]
    Png(#[from] png::DecodingError),
}

impl GridFileError {
    /// What would be right.
    #[must_use]
    pub const fn help(&self) -> &'static str {
        "give a map as `sonard map` writes it: map.yaml beside map.pgm (or a PNG)"
    }
}

/// What a PNG begins with.
const PNG: &[u8] = b"\x89PNG";
/// The most that an image takes in memory, bytes: as many as a grid has cells, in four colours.
const MOST_BYTES: usize = 1 << 28;
/// What map_server takes for unknown.
const UNKNOWN: u8 = 127;

/// A map by its description, or by the folder that holds `map.yaml`; `note` is told of each file before it is read.
///
/// # Errors
/// The file that can't be read or is none of a map.
pub fn read(path: &Path, mut note: impl FnMut(&Path)) -> Result<Grid, GridFileError> {
    let yaml_path = if path.is_dir() { path.join("map.yaml") } else { path.to_path_buf() };
    note(&yaml_path);
    let yaml = description(&yaml_path)
        .map_err(|fault| GridFileError { path: yaml_path.clone(), fault })?;
    let path = yaml_path.parent().unwrap_or(Path::new("")).join(&yaml.image);
    note(&path);
    image(&path, &yaml).map_err(|fault| GridFileError { path, fault })
}

fn description(path: &Path) -> Result<MapYaml, GridFileFault> {
    Ok(MapYaml::from_text(&fs::read_to_string(path)?)?)
}

fn image(path: &Path, yaml: &MapYaml) -> Result<Grid, GridFileFault> {
    let bytes = fs::read(path)?;
    if !bytes.starts_with(PNG) {
        return Ok(from_pgm(&bytes, yaml)?);
    }
    let (size, pixels) = grey(&bytes)?;
    Ok(from_pixels(size, &pixels, yaml)?)
}

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
