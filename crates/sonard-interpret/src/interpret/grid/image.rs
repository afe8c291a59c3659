//! Maps as the pair of files that ROS's map_server reads: an image and a description.

use serde::{Deserialize, Deserializer, Serialize, de};
use thiserror::Error;

use super::{Grid, GridError, GridShape};
use sonard_model::geometry::DVec2;

/// The description, `map.yaml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapYaml {
    /// File name of the image.
    pub image: String,
    /// Side of a cell, metres.
    pub resolution: f64,
    /// Pose of the lower left corner: metres, metres, radians.
    pub origin: [f64; 3],
    /// 0: dark is occupied.
    #[serde(default, deserialize_with = "zero_or_one")]
    pub negate: u8,
    /// Occupied above this probability.
    #[serde(default = "occupied_thresh")]
    pub occupied_thresh: f64,
    /// Free below this probability.
    #[serde(default = "free_thresh")]
    pub free_thresh: f64,
    /// Meaning of a shade.
    #[serde(default)]
    pub mode: MapMode,
    /// True if shades are probabilities, to be taken as they are: of maps that this program wrote.
    #[serde(skip)]
    pub is_graded: bool,
}

/// Meaning of the shades of a map's image, by map_server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MapMode {
    /// Occupied above one threshold, free below the other, else unknown.
    #[default]
    Trinary,
    /// The same, with probabilities between the thresholds.
    Scale,
    /// The occupancy itself, 0 to 100; more is unknown.
    Raw,
}

const fn occupied_thresh() -> f64 {
    0.65
}

const fn free_thresh() -> f64 {
    0.196
}

/// 0 or 1, as a number or as `false` or `true`.
fn zero_or_one<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u8, D::Error> {
    let value = serde_json::Value::deserialize(deserializer)?;
    match value {
        serde_json::Value::Bool(negate) => Ok(u8::from(negate)),
        serde_json::Value::Number(number) if number.as_f64().is_some() => {
            Ok(u8::from(number.as_f64() != Some(0.0)))
        }
        other => Err(de::Error::custom(format!("negate is {other}, and should be 0 or 1"))),
    }
}

/// The mark of a description whose map has probabilities for shades.
const GRADED: &str = "# shades are probabilities of being occupied: 1 - shade / 255";

/// An error in the image of a map or its description.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ImageError {
    /// Not a PGM.
    #[error("byte {at}: {what}")]
    Image {
        /// Where in the file, from 0.
        at: usize,
        /// What is wrong and what would be right.
        what: &'static str,
    },
    /// The description lacks a key or has a wrong value, with its line.
    #[error("the description is no YAML of a map: {0}")]
    Yaml(String),
    /// Such a grid can't be.
    #[error(transparent)]
    Grid(#[from] GridError),
}

/// The image: a pixel is `255 (1 - p)`, so that free is bright and occupied dark; the first row
/// is the map's upper one.
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

/// A map from its image and description.
///
/// # Errors
/// When the image is no PGM, is cut off, or makes no grid.
pub fn from_pgm(bytes: &[u8], yaml: &MapYaml) -> Result<Grid, ImageError> {
    let (size, pixels) = pixels(bytes)?;
    from_pixels(size, &pixels, yaml)
}

/// A map from the shades of its image, 0 to 255 and `None` for what is transparent, row by row from the upper left one, and
/// its description.
///
/// # Errors
/// When they are too few for this width and height, or make no grid.
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
        pixels.iter().flatten().all(|pixel| OF_MAP_SAVER.contains(&dark_on_light(*pixel)));
    let probability = |pixel: &Option<u8>| match pixel {
        Some(pixel) => yaml.probability(dark_on_light(*pixel), is_of_map_saver),
        None => 0.5,
    };
    let rows = pixels.chunks(shape.width).rev();
    let cells: Vec<f64> = rows.flat_map(|row| row.iter().map(probability)).collect();
    Ok(Grid::of_probabilities(shape, &cells))
}

/// What map_saver of ROS writes: occupied, unknown and free. A map of probabilities has other shades.
const OF_MAP_SAVER: [u8; 4] = [0, UNKNOWN, 254, 255];
const UNKNOWN: u8 = 205;

/// Width and height, and the shades of a PGM, plain (P2) or binary (P5) (Netpbm, pgm(5)).
fn pixels(bytes: &[u8]) -> Result<([usize; 2], Vec<Option<u8>>), ImageError> {
    let refuse = |at, what| Err(ImageError::Image { at, what });
    let is_plain = bytes.starts_with(b"P2");
    if !is_plain && !bytes.starts_with(b"P5") {
        return refuse(
            0,
            "a map's image must be a PGM, which begins with P5 or P2, or a PNG; convert others: `convert IMAGE map.pgm`",
        );
    }
    let mut at = 2;
    let mut next = || number(bytes, &mut at);
    let (Some(width), Some(height), Some(most)) = (next(), next(), next()) else {
        return refuse(at, "width, height and greatest value must follow P5 or P2");
    };
    if width == 0 || height == 0 || width.saturating_mul(height) > super::MOST_CELLS as usize {
        return refuse(at, "the image has no pixel, or too many");
    }
    if !(1..=65_535).contains(&most) {
        return refuse(at, "the greatest value must be from 1 to 65535");
    }
    let shade = |value: usize| {
        let value = value.min(most);
        Some(if most == 255 { value } else { (255 * value + most / 2) / most } as u8)
    };
    let count = width * height;
    let mut shades = Vec::new();
    if is_plain {
        while shades.len() < count {
            match number(bytes, &mut at) {
                Some(value) => shades.push(shade(value)),
                None => return refuse(at, "the image ends before its last pixel"),
            }
        }
        return Ok(([width, height], shades));
    }
    // One blank ends the header.
    let body = bytes.get(at + 1..).unwrap_or_default();
    if most < 256 {
        shades.extend(body.iter().take(count).map(|value| shade(usize::from(*value))));
    } else {
        let pairs = body.chunks_exact(2).take(count);
        shades.extend(pairs.map(|pair| shade(usize::from(u16::from_be_bytes([pair[0], pair[1]])))));
    }
    Ok(([width, height], shades))
}

/// The next number of a PGM, behind blanks and comments.
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
    /// The description of a map whose image has this file name.
    #[must_use]
    pub fn of(shape: &GridShape, image: &str) -> Self {
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

    /// The probability of a cell of such a shade, dark for occupied.
    fn probability(&self, shade: u8, is_of_map_saver: bool) -> f64 {
        let dark = 1.0 - f64::from(shade) / 255.0;
        if self.mode == MapMode::Raw {
            return if shade <= 100 { f64::from(shade) / 100.0 } else { 0.5 };
        }
        if is_of_map_saver && shade == UNKNOWN {
            return 0.5;
        }
        if self.is_graded {
            // 127 and 128 are the two sides of unknown.
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

    /// As text.
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

    /// From text, YAML with the keys that map_server knows.
    ///
    /// # Errors
    /// When a key that is needed is missing or a value is not of its kind.
    pub fn from_text(text: &str) -> Result<Self, ImageError> {
        let plain = text.trim_start_matches('\u{feff}');
        let read: Self =
            serde_saphyr::from_str(plain).map_err(|error| ImageError::Yaml(error.to_string()))?;
        let numbers = [read.resolution, read.occupied_thresh, read.free_thresh];
        if numbers.iter().chain(&read.origin).any(|number| !number.is_finite()) {
            return Err(ImageError::Yaml("a number in it is not finite".to_owned()));
        }
        Ok(Self { is_graded: plain.lines().any(|line| line.trim() == GRADED), ..read })
    }
}
