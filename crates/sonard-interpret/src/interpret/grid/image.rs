//! Maps in the format of ROS's map_server: an image and a YAML description.

use serde::{Deserialize, Deserializer, Serialize, de};
use thiserror::Error;

use super::{Grid, GridError, GridShape};
use sonard_model::geometry::DVec2;

/// Description of a map, `map.yaml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapYaml {
    /// File name of the image.
    pub image: String,
    /// Side of a cell, metres.
    pub resolution: f64,
    /// Pose of the lower left corner: metres, metres, radians.
    pub origin: [f64; 3],
    /// 1 if the shades are inverted; 0: dark is occupied.
    #[serde(default, deserialize_with = "zero_or_one")]
    pub negate: u8,
    /// Occupied above this probability.
    #[serde(default = "occupied_thresh")]
    pub occupied_thresh: f64,
    /// Free below this probability.
    #[serde(default = "free_thresh")]
    pub free_thresh: f64,
    /// Interpretation of the shades.
    #[serde(default)]
    pub mode: MapMode,
    /// `true` if shades are probabilities to be used unchanged: in maps written by this program.
    #[serde(skip)]
    pub is_graded: bool,
}

/// Interpretation of the shades of a map image by map_server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MapMode {
    /// Occupied above one threshold, free below the other, else unknown.
    #[default]
    Trinary,
    /// Trinary, with probabilities between the thresholds.
    Scale,
    /// Occupancy itself, 0 to 100; larger values are unknown.
    Raw,
}

const fn occupied_thresh() -> f64 {
    0.65
}

const fn free_thresh() -> f64 {
    0.196
}

/// Accepts 0 or 1, as a number or a boolean.
fn zero_or_one<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u8, D::Error> {
    let value = serde_json::Value::deserialize(deserializer)?;
    match value {
        serde_json::Value::Bool(negate) => Ok(u8::from(negate)),
        serde_json::Value::Number(number) if number.as_f64().is_some() => {
            Ok(u8::from(number.as_f64() != Some(0.0)))
        }
        other => Err(de::Error::custom(format!("negate is {other}, but must be 0 or 1"))),
    }
}

/// Comment that marks a description whose shades are probabilities.
const GRADED: &str = "# shades are probabilities of being occupied: 1 - shade / 255";

/// Error in the image of a map or its description.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ImageError {
    /// Invalid PGM.
    #[error("byte {at}: {what}")]
    Image {
        /// Byte offset in the file.
        at: usize,
        /// Description of the error.
        what: &'static str,
    },
    /// Missing key or wrong value in the description, with its line.
    #[error("invalid map description: {0}")]
    Yaml(String),
    /// Invalid grid dimensions.
    #[error(transparent)]
    Grid(#[from] GridError),
}

/// Encodes the map as a binary PGM: a pixel is `255 (1 - p)`, so free space is bright and
/// occupied space dark; the first row is the top of the map.
#[must_use]
pub fn to_pgm(grid: &Grid) -> Vec<u8> {
    let shape = grid.shape();
    let mut bytes = format!("P5\n{} {}\n255\n", shape.width, shape.height).into_bytes();
    for row in (0..shape.height).rev() {
        bytes.extend((0..shape.width).map(|column| {
            let p = grid.probability(row * shape.width + column);
            (255.0 * (1.0 - p)).round() as u8
        }));
    }
    bytes
}

/// Decodes a map from its image and description.
///
/// # Errors
/// Not a PGM, truncated image, or invalid grid dimensions.
pub fn from_pgm(bytes: &[u8], yaml: &MapYaml) -> Result<Grid, ImageError> {
    let (size, pixels) = pixels(bytes)?;
    from_pixels(size, &pixels, yaml)
}

/// Map from the shades of its image and its description. Shades are 0 to 255, `None` if
/// transparent, row by row from the upper left.
///
/// # Errors
/// Too few pixels for this width and height, or invalid grid dimensions.
pub fn from_pixels(
    [width, height]: [usize; 2],
    pixels: &[Option<u8>],
    yaml: &MapYaml,
) -> Result<Grid, ImageError> {
    let shape = GridShape::covering(
        DVec2::new(yaml.origin[0], yaml.origin[1]),
        DVec2::new(yaml.origin[0], yaml.origin[1])
            + yaml.resolution * DVec2::new(width as f64, height as f64),
        yaml.resolution,
    )?;
    let pixels = pixels.get(..shape.cells()).ok_or(ImageError::Image {
        at: pixels.len(),
        what: "the image ends before its last pixel",
    })?;
    let dark_on_light = |pixel: u8| if yaml.negate == 0 { pixel } else { 255 - pixel };
    let is_of_map_saver =
        pixels.iter().flatten().all(|pixel| MAP_SAVER.contains(&dark_on_light(*pixel)));
    let probability = |pixel: &Option<u8>| match pixel {
        Some(pixel) => yaml.probability(dark_on_light(*pixel), is_of_map_saver),
        None => 0.5,
    };
    let rows = pixels.chunks(shape.width).rev();
    let cells: Vec<f64> = rows.flat_map(|row| row.iter().map(probability)).collect();
    Ok(Grid::from_probabilities(shape, &cells))
}

/// Shades written by ROS's map_saver: occupied, unknown and free. A map of probabilities has
/// others.
const MAP_SAVER: [u8; 4] = [0, UNKNOWN, 254, 255];
const UNKNOWN: u8 = 205;

/// Width, height and shades of a PGM, plain (P2) or binary (P5) (Netpbm, pgm(5)).
fn pixels(bytes: &[u8]) -> Result<([usize; 2], Vec<Option<u8>>), ImageError> {
    let reject = |at, what| Err(ImageError::Image { at, what });
    let is_plain = bytes.starts_with(b"P2");
    if !is_plain && !bytes.starts_with(b"P5") {
        return reject(
            0,
            "a map's image must be a PGM, which begins with P5 or P2, or a PNG; convert others: `convert IMAGE map.pgm`",
        );
    }
    let mut at = 2;
    let mut next = || number(bytes, &mut at);
    let (Some(width), Some(height), Some(max)) = (next(), next(), next()) else {
        return reject(at, "width, height and maximum value must follow P5 or P2");
    };
    if width == 0 || height == 0 || width.saturating_mul(height) > super::MAX_CELLS as usize {
        return reject(at, "the image has no pixels, or too many");
    }
    if !(1..=65_535).contains(&max) {
        return reject(at, "the maximum value must be from 1 to 65535");
    }
    let shade = |value: usize| {
        let value = value.min(max);
        Some(if max == 255 { value } else { (255 * value + max / 2) / max } as u8)
    };
    let count = width * height;
    let mut shades = Vec::new();
    if is_plain {
        while shades.len() < count {
            match number(bytes, &mut at) {
                Some(value) => shades.push(shade(value)),
                None => return reject(at, "the image ends before its last pixel"),
            }
        }
        return Ok(([width, height], shades));
    }
    // A single whitespace byte ends the header.
    let body = bytes.get(at + 1..).unwrap_or_default();
    if max < 256 {
        shades.extend(body.iter().take(count).map(|value| shade(usize::from(*value))));
    } else {
        let pairs = body.chunks_exact(2).take(count);
        shades.extend(pairs.map(|pair| shade(usize::from(u16::from_be_bytes([pair[0], pair[1]])))));
    }
    Ok(([width, height], shades))
}

/// Next number of a PGM, after whitespace and comments.
fn number(bytes: &[u8], at: &mut usize) -> Option<usize> {
    loop {
        match bytes.get(*at)? {
            b'#' => {
                while bytes.get(*at).is_some_and(|byte| *byte != b'\n') {
                    *at += 1;
                }
            }
            byte if byte.is_ascii_whitespace() => *at += 1,
            byte if byte.is_ascii_digit() => break,
            _ => return None,
        }
    }
    let mut number = 0_usize;
    while let Some(byte) = bytes.get(*at).filter(|byte| byte.is_ascii_digit()) {
        number = number.saturating_mul(10).saturating_add(usize::from(byte - b'0'));
        *at += 1;
    }
    Some(number)
}

impl MapYaml {
    /// Description of a map with the given image file name.
    #[must_use]
    pub fn new(shape: &GridShape, image: &str) -> Self {
        Self {
            image: image.to_owned(),
            resolution: shape.resolution_m,
            origin: [shape.origin.x, shape.origin.y, 0.0],
            negate: 0,
            occupied_thresh: occupied_thresh(),
            free_thresh: free_thresh(),
            mode: MapMode::Trinary,
            is_graded: true,
        }
    }

    /// Occupancy probability of a shade, dark for occupied.
    fn probability(&self, shade: u8, is_of_map_saver: bool) -> f64 {
        let dark = 1.0 - f64::from(shade) / 255.0;
        if self.mode == MapMode::Raw {
            return if shade <= 100 { f64::from(shade) / 100.0 } else { 0.5 };
        }
        if is_of_map_saver && shade == UNKNOWN {
            return 0.5;
        }
        if self.is_graded {
            // The two shades next to 0.5.
            return if matches!(shade, 127 | 128) { 0.5 } else { dark };
        }
        if dark > self.occupied_thresh {
            1.0
        } else if dark < self.free_thresh {
            0.0
        } else if self.mode == MapMode::Scale && self.occupied_thresh > self.free_thresh {
            (dark - self.free_thresh) / (self.occupied_thresh - self.free_thresh)
        } else {
            0.5
        }
    }

    /// Formats the description as YAML.
    #[must_use]
    pub fn to_text(&self) -> String {
        let [x, y, turn] = self.origin;
        let mode = match self.mode {
            MapMode::Trinary => "trinary",
            MapMode::Scale => "scale",
            MapMode::Raw => "raw",
        };
        let graded = if self.is_graded { format!("{GRADED}\n") } else { String::new() };
        format!(
            "image: {}\nresolution: {}\norigin: [{x}, {y}, {turn:.1}]\nnegate: {}\n\
             occupied_thresh: {}\nfree_thresh: {}\nmode: {mode}\n{graded}",
            self.image, self.resolution, self.negate, self.occupied_thresh, self.free_thresh
        )
    }

    /// Parses a YAML description with the keys known to map_server.
    ///
    /// # Errors
    /// A required key is missing or a value has the wrong type.
    pub fn from_text(text: &str) -> Result<Self, ImageError> {
        let plain = text.trim_start_matches('\u{feff}');
        let read: Self =
            serde_saphyr::from_str(plain).map_err(|error| ImageError::Yaml(error.to_string()))?;
        let numbers = [read.resolution, read.occupied_thresh, read.free_thresh];
        if numbers.iter().chain(&read.origin).any(|number| !number.is_finite()) {
            return Err(ImageError::Yaml("a number is not finite".to_owned()));
        }
        Ok(Self { is_graded: plain.lines().any(|line| line.trim() == GRADED), ..read })
    }
}
