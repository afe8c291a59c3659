//! Occupancy grids on disk, as ROS's map_server has them: a description (YAML), and beside it an image, PGM or PNG.

use std::{
    fs,
    io::{self, Cursor, Read as _},
    path::{Path, PathBuf},
};

use sonard_interpret::interpret::grid::{
    Grid, ImageError, MapYaml, TraceSettings, WallLine, from_pgm, from_pixels, trace,
};
use sonard_model::{geometry::DVec2, scene::Surfaces};
use thiserror::Error;

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
    /// The image that the description names is not there, or can't be read.
    #[error("the image that `image:` names: {0}")]
    Image(#[source] io::Error),
    /// The image of a map in place of its description.
    #[error("it is an image, not the description of a map")]
    IsImage,
    /// A map that is turned about its lower left corner, radians.
    #[error("the map is turned by {0} radians (the third number of `origin`)")]
    Turned(f64),
    /// It is no PNG, or too large a one.
    #[error("PNG: {0}")]
    Png(#[from] png::DecodingError),
}

impl GridFileError {
    /// What would be right.
    #[must_use]
    pub const fn help(&self) -> &'static str {
        match self.fault {
            GridFileFault::Turned(_) => {
                "give a map along the axes; `sonard scene from-grid` reads turned ones"
            }
            GridFileFault::Image(_) => "put the image beside the description, or correct `image:`",
            GridFileFault::IsImage => {
                "give its description: a text beside it with `image: NAME`, `resolution: 0.05` and `origin: [0, 0, 0]`"
            }
            _ => {
                "give a map as `sonard map` or map_saver writes it: map.yaml beside map.pgm (or a PNG)"
            }
        }
    }
}

/// What a PNG begins with.
const PNG: &[u8] = b"\x89PNG";
/// The most that an image takes in memory, bytes: as many as a grid has cells, in four colours.
const MOST_BYTES: usize = 1 << 28;

/// A map by its description, or by the folder that holds `map.yaml`, with probabilities for shades; `note` is told of each
/// file before it is read.
///
/// # Errors
/// The file that can't be read or is none of a map, or a map that is turned.
pub fn read(path: &Path, note: impl FnMut(&Path)) -> Result<Grid, GridFileError> {
    let with_shades = |yaml: MapYaml| MapYaml { is_graded: true, ..yaml };
    let (grid, yaml) = read_as(path, with_shades, note)?;
    match yaml.origin[2] {
        0.0 => Ok(grid),
        yaw => Err(GridFileError { path: path.to_path_buf(), fault: GridFileFault::Turned(yaw) }),
    }
}

/// Walls of a map that is read by the thresholds and the mode of its description, as map_server does, as surfaces in its frame, with its description. Without a
/// tolerance, walls along rows and columns of cells stay where the cells are, unless this program mapped them; lengths are
/// metres.
///
/// # Errors
/// The file that can't be read or is none of a map.
pub fn read_walls(
    path: &Path,
    tolerance_m: Option<f64>,
    least_m: Option<f64>,
    note: impl FnMut(&Path),
) -> Result<(Surfaces, MapYaml), GridFileError> {
    let (grid, yaml) = read_as(path, |yaml| yaml, note)?;
    let by_default = TraceSettings::of_cells(grid.shape().resolution_m);
    let settings = TraceSettings {
        tolerance_m: tolerance_m.unwrap_or(by_default.tolerance_m),
        least_m: least_m.unwrap_or(by_default.least_m),
        // What a sonar mapped has ragged walls; others draw them as they are.
        keeps_rows: !yaml.is_graded && tolerance_m.is_none(),
        ..by_default
    };
    let [x_m, y_m, yaw_rad] = yaml.origin;
    let (origin, turn) = (DVec2::new(x_m, y_m), DVec2::from_angle(yaw_rad));
    let turned =
        |corner: DVec2| if yaw_rad == 0.0 { corner } else { origin + turn.rotate(corner - origin) };
    let mut found = Surfaces::default();
    for WallLine { corners, is_closed } in trace(&grid, &settings) {
        found.walls("wall", corners.into_iter().map(turned).collect(), is_closed);
    }
    Ok((found, yaml))
}

fn read_as(
    path: &Path,
    as_meant: impl Fn(MapYaml) -> MapYaml,
    mut note: impl FnMut(&Path),
) -> Result<(Grid, MapYaml), GridFileError> {
    let yaml_path = if path.is_dir() { path.join("map.yaml") } else { path.to_path_buf() };
    note(&yaml_path);
    let yaml = description(&yaml_path)
        .map(as_meant)
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

/// The longest description that is read, bytes: more is none.
const MAX_DESCRIPTION_BYTES: u64 = 1 << 20;

fn description(path: &Path) -> Result<MapYaml, GridFileFault> {
    let mut bytes = Vec::new();
    fs::File::open(path)?.take(MAX_DESCRIPTION_BYTES).read_to_end(&mut bytes)?;
    if IMAGES.iter().any(|magic| bytes.starts_with(magic)) {
        return Err(GridFileFault::IsImage);
    }
    Ok(MapYaml::from_text(&String::from_utf8_lossy(&bytes))?)
}

/// First bytes of images that are given in place of a description.
const IMAGES: [&[u8]; 4] = [PNG, b"P5", b"P2", b"\xff\xd8\xff"];

fn image(path: &Path, yaml: &MapYaml) -> Result<Grid, GridFileFault> {
    let bytes = fs::read(path)?;
    if !bytes.starts_with(PNG) {
        return Ok(from_pgm(&bytes, yaml)?);
    }
    let (size, pixels) = grey(&bytes)?;
    Ok(from_pixels(size, &pixels, yaml)?)
}

/// Size and brightness of the pixels of a PNG; those that one sees through are unknown.
fn grey(bytes: &[u8]) -> Result<([usize; 2], Vec<Option<u8>>), png::DecodingError> {
    let limits = png::Limits { bytes: MOST_BYTES };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info()?;
    let size = reader.output_buffer_size().filter(|size| *size <= MOST_BYTES);
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
