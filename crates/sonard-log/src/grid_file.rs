//! Occupancy grids in the format of ROS's map_server: a description (YAML) and an image (PGM, PNG).

use std::{
    fs,
    io::{self, Cursor, Read as _},
    path::{Path, PathBuf},
};

use sonard_interpret::interpret::grid::{
    Grid, ImageError, MapYaml, TraceSettings, TracedLine, from_pgm, from_pixels, trace,
};
use sonard_model::{geometry::DVec2, scene::Surfaces};
use thiserror::Error;

/// Error in a map file, with its path.
#[derive(Debug, Error)]
#[error("{}: {fault}", path.display())]
pub struct GridFileError {
    /// Path of the file.
    pub path: PathBuf,
    /// Fault of the file.
    #[source]
    pub fault: GridFileFault,
}

/// Fault of a map file.
#[derive(Debug, Error)]
pub enum GridFileFault {
    /// Failure to read the file.
    #[error(transparent)]
    Disk(#[from] io::Error),
    /// Invalid description or image.
    #[error(transparent)]
    Map(#[from] ImageError),
    /// Failure to read the image named by the description.
    #[error("cannot read the file of `image:`: {0}")]
    Image(#[source] io::Error),
    /// Image given instead of the description.
    #[error("file is an image, not the description of a map")]
    IsImage,
    /// Map rotated about its lower left corner, radians.
    #[error("the map is rotated by {0} radians (the third number of `origin`)")]
    Rotated(f64),
    /// Invalid or too large PNG.
    #[error("PNG: {0}")]
    Png(#[from] png::DecodingError),
}

impl GridFileError {
    /// Suggested correction for the user.
    #[must_use]
    pub const fn help(&self) -> &'static str {
        match self.fault {
            GridFileFault::Rotated(_) => {
                "use an axis-aligned map; `sonard scene from-grid` reads rotated ones"
            }
            GridFileFault::Image(_) => {
                "move the image to the description's folder, or correct `image:`"
            }
            GridFileFault::IsImage => {
                "name its description: a text file with `image: NAME`, `resolution: 0.05` and \
                 `origin: [0, 0, 0]`"
            }
            _ => {
                "name a map written by `sonard map` or map_saver: map.yaml with map.pgm (or a PNG)"
            }
        }
    }
}

/// Magic bytes of PNG.
const PNG: &[u8] = b"\x89PNG";
/// Maximum size of a decoded image, bytes: the maximum number of cells with four channels.
const MAX_IMAGE_BYTES: usize = 1 << 28;

/// Reads a map by its description, or by a folder with `map.yaml`, with grey levels as
/// probabilities. `note` receives the path of each file before it is read.
///
/// # Errors
/// Returns an error for an unreadable or invalid file, or a rotated map.
pub fn read(path: &Path, note: impl FnMut(&Path)) -> Result<Grid, GridFileError> {
    let with_shades = |yaml: MapYaml| MapYaml { is_graded: true, ..yaml };
    let (grid, yaml) = read_as(path, with_shades, note)?;
    match yaml.origin[2] {
        0.0 => Ok(grid),
        yaw => Err(GridFileError { path: path.to_path_buf(), fault: GridFileFault::Rotated(yaw) }),
    }
}

/// Reads the walls of a map as surfaces in the map's frame, with the map's description.
///
/// Cells are classified by thresholds and mode of the description, as by map_server. Without a
/// tolerance (metres), walls along rows and columns of cells keep their positions, except in maps
/// from this program. Walls shorter than `min_length_m` (metres) are dropped.
///
/// # Errors
/// Returns an error for an unreadable or invalid file.
pub fn read_walls(
    path: &Path,
    tolerance_m: Option<f64>,
    min_length_m: Option<f64>,
    note: impl FnMut(&Path),
) -> Result<(Surfaces, MapYaml), GridFileError> {
    let (grid, yaml) = read_as(path, |yaml| yaml, note)?;
    let defaults = TraceSettings::for_cells(grid.shape().resolution_m);
    let settings = TraceSettings {
        tolerance_m: tolerance_m.unwrap_or(defaults.tolerance_m),
        min_length_m: min_length_m.unwrap_or(defaults.min_length_m),
        // Walls mapped by sonar are ragged; other maps have exact rows.
        keeps_rows: !yaml.is_graded && tolerance_m.is_none(),
        ..defaults
    };
    let [x_m, y_m, yaw_rad] = yaml.origin;
    let (origin, rotation) = (DVec2::new(x_m, y_m), DVec2::from_angle(yaw_rad));
    let rotated = |corner: DVec2| match yaw_rad {
        0.0 => corner,
        _ => origin + rotation.rotate(corner - origin),
    };
    let mut surfaces = Surfaces::default();
    for TracedLine { corners, is_closed } in trace(&grid, &settings) {
        surfaces.walls("wall", corners.into_iter().map(rotated).collect(), is_closed);
    }
    Ok((surfaces, yaml))
}

fn read_as(
    path: &Path,
    adapt: impl Fn(MapYaml) -> MapYaml,
    mut note: impl FnMut(&Path),
) -> Result<(Grid, MapYaml), GridFileError> {
    let yaml_path = if path.is_dir() { path.join("map.yaml") } else { path.to_path_buf() };
    note(&yaml_path);
    let yaml = description(&yaml_path)
        .map(adapt)
        .map_err(|fault| GridFileError { path: yaml_path.clone(), fault })?;
    let path = yaml_path.parent().unwrap_or(Path::new("")).join(&yaml.image);
    note(&path);
    match image(&path, &yaml) {
        Ok(grid) => Ok((grid, yaml)),
        Err(GridFileFault::Disk(error)) => {
            Err(GridFileError { path, fault: GridFileFault::Image(error) })
        }
        Err(fault) => Err(GridFileError { path, fault }),
    }
}

/// Maximum number of bytes read of a description.
const MAX_DESCRIPTION_BYTES: u64 = 1 << 20;

fn description(path: &Path) -> Result<MapYaml, GridFileFault> {
    let mut bytes = Vec::new();
    fs::File::open(path)?.take(MAX_DESCRIPTION_BYTES).read_to_end(&mut bytes)?;
    if IMAGES.iter().any(|magic| bytes.starts_with(magic)) {
        return Err(GridFileFault::IsImage);
    }
    Ok(MapYaml::from_text(&String::from_utf8_lossy(&bytes))?)
}

/// Magic bytes of images, to detect an image given instead of the description.
const IMAGES: [&[u8]; 4] = [PNG, b"P5", b"P2", b"\xff\xd8\xff"];

fn image(path: &Path, yaml: &MapYaml) -> Result<Grid, GridFileFault> {
    let bytes = fs::read(path)?;
    if !bytes.starts_with(PNG) {
        return Ok(from_pgm(&bytes, yaml)?);
    }
    let (size, pixels) = grey(&bytes)?;
    Ok(from_pixels(size, &pixels, yaml)?)
}

/// Decodes size and grey levels of a PNG; transparent pixels are unknown (`None`).
fn grey(bytes: &[u8]) -> Result<([usize; 2], Vec<Option<u8>>), png::DecodingError> {
    let limits = png::Limits { bytes: MAX_IMAGE_BYTES };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info()?;
    let size = reader.output_buffer_size().filter(|size| *size <= MAX_IMAGE_BYTES);
    let mut image = vec![0; size.ok_or(png::DecodingError::LimitsExceeded)?];
    let frame = reader.next_frame(&mut image)?;
    let channels = frame.color_type.samples();
    let pixel = |samples: &[u8]| match *samples {
        [.., alpha] if matches!(channels, 2 | 4) && alpha < 128 => None,
        [grey] | [grey, _] => Some(grey),
        [r, g, b, ..] => Some(((u16::from(r) + u16::from(g) + u16::from(b)) / 3) as u8),
        [] => None,
    };
    image.truncate(frame.buffer_size());
    let pixels = image.chunks(channels).map(pixel).collect();
    Ok(([frame.width as usize, frame.height as usize], pixels))
}
