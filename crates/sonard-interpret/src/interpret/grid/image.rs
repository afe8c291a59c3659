//! Maps as the pair of files that ROS's map_server reads: an image and a description.

use serde::{Deserialize, Serialize};
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
    pub negate: u8,
    /// Occupied above this probability.
    pub occupied_thresh: f64,
    /// Free below this probability.
    pub free_thresh: f64,
}

/// An error in the image of a map or its description.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ImageError {
    /// Not a binary PGM with 8 bits a pixel.
    #[error("byte {at}: {what}")]
    Image {
        /// Where in the file, from 0.
        at: usize,
        /// What is wrong and what would be right.
        what: &'static str,
    },
    /// The description lacks a line or has a wrong value.
    #[error("line {line}: {what}")]
    Yaml {
        /// Line, from 1; 0 when a line is missing.
        line: usize,
        /// What is wrong.
        what: String,
    },
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
/// When the image is not a binary PGM of 8 bits, is cut off, or makes no grid.
pub fn from_pgm(bytes: &[u8], yaml: &MapYaml) -> Result<Grid, ImageError> {
    let (width, height, start) = header(bytes)?;
    from_pixels([width, height], bytes.get(start..).unwrap_or_default(), yaml)
}

/// A map from the pixels of its image, 8 bits each, row by row from the upper left one, and its description.
///
/// # Errors
/// When they are too few for this width and height, or make no grid.
pub fn from_pixels(
    [width, height]: [usize; 2],
    pixels: &[u8],
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
    let is_of_map_saver = pixels.iter().all(|pixel| OF_MAP_SAVER.contains(pixel));
    let probability = |pixel: u8| {
        let dark = 1.0 - f64::from(pixel) / 255.0;
        // 127 and 128 are the two sides of unknown.
        let is_unknown = matches!(pixel, 127 | 128) || (is_of_map_saver && pixel == UNKNOWN);
        let p = if is_unknown { 0.5 } else { dark };
        if yaml.negate == 0 { p } else { 1.0 - p }
    };
    let rows = pixels.chunks(shape.width).rev();
    let cells: Vec<f64> =
        rows.flat_map(|row| row.iter().map(|pixel| probability(*pixel))).collect();
    Ok(Grid::of_probabilities(shape, &cells))
}

/// What map_saver of ROS writes: occupied, unknown and free. A map of probabilities has other shades.
const OF_MAP_SAVER: [u8; 4] = [0, UNKNOWN, 254, 255];
const UNKNOWN: u8 = 205;

/// Width, height and where the pixels begin.
fn header(bytes: &[u8]) -> Result<(usize, usize, usize), ImageError> {
    let refuse = |at, what| Err(ImageError::Image { at, what });
    if !bytes.starts_with(b"P5") {
        return refuse(0, "a map's image must be a binary PGM, which begins with P5");
    }
    let mut at = 2;
    let mut numbers = [0_usize; 3];
    for number in &mut numbers {
        loop {
            match bytes.get(at) {
                Some(b'#') => {
                    while bytes.get(at).is_some_and(|byte| *byte != b'\n') {
                        at += 1;
                    }
                }
                Some(byte) if byte.is_ascii_whitespace() => at += 1,
                Some(byte) if byte.is_ascii_digit() => break,
                _ => return refuse(at, "width, height and greatest value must follow P5"),
            }
        }
        while let Some(byte) = bytes.get(at).filter(|byte| byte.is_ascii_digit()) {
            *number = number.saturating_mul(10).saturating_add(usize::from(byte - b'0'));
            at += 1;
        }
    }
    let [width, height, most] = numbers;
    if most != 255 {
        return refuse(at, "the greatest value must be 255");
    }
    if width == 0 || height == 0 || width.saturating_mul(height) > super::MOST_CELLS as usize {
        return refuse(at, "the image has no pixel, or too many");
    }
    Ok((width, height, at + 1))
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
            occupied_thresh: 0.65,
            free_thresh: 0.196,
        }
    }

    /// As text.
    #[must_use]
    pub fn to_text(&self) -> String {
        let [x, y, turn] = self.origin;
        format!(
            "image: {}\nresolution: {}\norigin: [{x}, {y}, {turn:.1}]\nnegate: {}\n\
             occupied_thresh: {}\nfree_thresh: {}\nmode: trinary\n",
            self.image, self.resolution, self.negate, self.occupied_thresh, self.free_thresh
        )
    }

    /// From text: the lines that map_server knows, in any order.
    ///
    /// # Errors
    /// When a line that is needed is missing or a value is not of its kind.
    pub fn from_text(text: &str) -> Result<Self, ImageError> {
        let value = |key: &str| {
            text.lines().enumerate().find_map(|(at, line)| {
                let (name, value) = line.split('#').next()?.split_once(':')?;
                (name.trim() == key).then(|| (at + 1, value.trim().trim_matches(['"', '\''])))
            })
        };
        let needed = |key: &str| {
            value(key)
                .ok_or_else(|| ImageError::Yaml { line: 0, what: format!("`{key}:` is missing") })
        };
        let number = |(line, text): (usize, &str)| {
            text.parse::<f64>()
                .ok()
                .filter(|number| number.is_finite())
                .ok_or_else(|| ImageError::Yaml { line, what: format!("`{text}` is not a number") })
        };
        let (line, place) = needed("origin")?;
        let parts: Vec<f64> = place
            .trim_matches(['[', ']'])
            .split(',')
            .map(|part| number((line, part.trim())))
            .collect::<Result<_, _>>()?;
        let origin = parts.try_into().map_err(|_| ImageError::Yaml {
            line,
            what: "origin must be [x, y, yaw]".to_owned(),
        })?;
        let or = |key, otherwise| value(key).map_or(Ok(otherwise), number);
        Ok(Self {
            image: needed("image")?.1.to_owned(),
            resolution: number(needed("resolution")?)?,
            origin,
            negate: u8::from(or("negate", 0.0)? != 0.0),
            occupied_thresh: or("occupied_thresh", 0.65)?,
            free_thresh: or("free_thresh", 0.196)?,
        })
    }
}
