//! Image sources of a room: every path by mirror reflections from a source to receivers.
//!
//! A receiver receives sound that walls have reflected as if it came straight from a mirror image
//! of the source (Allen and Berkley, JASA 65, 1979; Borish, JASA 75, 1984). [`image_sources`] finds
//! the images that are visible from each receiver in any room of flat, upright walls, with or
//! without floor and ceiling; [`BoxRoom`] has the closed form for a box.

mod boxes;
mod heights;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use smallvec::SmallVec;
use thiserror::Error;

pub use boxes::BoxRoom;
use heights::{FlatLimits, HeightImage};

use super::{
    TooCostly,
    paths::{MirrorPath, PathSettings, Paths},
};
use crate::{geometry::DVec2, scene::Scene};

/// Image sources that receivers see, by receiver and then by distance. All lists have an entry for
/// each image.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImageSources {
    /// Index of the receiver.
    pub receivers: Vec<u32>,
    /// Position of the image, metres; height 0 in a room without floor and ceiling.
    pub positions_m: Vec<[f64; 3]>,
    /// Distance from the image to the receiver, metres: the length of the path.
    pub distances_m: Vec<f64>,
    /// Product of the reflectances along the path.
    pub reflectances: Vec<f64>,
    /// Surfaces of all paths, one path after another.
    surfaces: Vec<u32>,
    /// End of each path's surfaces.
    ends: Vec<usize>,
}

/// Room or position for which image sources are not defined, or too many of them.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ImageSourceError {
    /// Cylinder in the room: a curved surface has no image source.
    #[error("`{id}` is a cylinder: only flat walls have image sources")]
    Cylinder {
        /// Name of the cylinder.
        id: String,
    },
    /// Wall that ends below the ceiling or above the floor.
    #[error(
        "`{id}` ends below the ceiling or above the floor: only walls of full height are supported"
    )]
    LowWall {
        /// Name of the wall.
        id: String,
    },
    /// Position that is not finite, or not in the room.
    #[error("{what} is at ({}, {}, {}): it must be inside the room", at_m[0], at_m[1], at_m[2])]
    Position {
        /// Source, or number of the receiver.
        what: String,
        /// Position, metres.
        at_m: [f64; 3],
    },
    /// Size or reflectance of a box outside its range.
    #[error("{name} of the box is {value}: it must be {expected}")]
    Box {
        /// Name of the property.
        name: &'static str,
        /// Given value.
        value: f64,
        /// Valid range.
        expected: &'static str,
    },
    /// Too many images.
    #[error(transparent)]
    TooCostly(#[from] TooCostly),
}

/// Finds the image sources of a scene that each receiver sees, up to `max_order` reflections.
///
/// Positions are `[x, y, z]` in metres. In a scene with floor or ceiling they must be between them,
/// in a planar scene their heights are ignored. The images are those of the cleaned-up plan
/// ([`Scene::floor_plan`]); interior walls hide images and reflect on both sides. Surfaces are
/// numbered as the scene's walls, then the floor, then the ceiling. An image that is seen exactly
/// past a corner is listed once, with one of its sequences of walls. The direct path is of order
/// 0; it is not listed for a receiver at the source.
///
/// # Errors
/// A scene with cylinders or low walls, a position outside the room, or too many images.
pub fn image_sources(
    scene: &Scene,
    source_m: [f64; 3],
    receivers_m: &[[f64; 3]],
    max_order: u16,
) -> Result<ImageSources, ImageSourceError> {
    check(scene)?;
    let limits = FlatLimits::new(scene);
    let source_m = limits.place("the source", source_m)?;
    let receivers = receivers_m.iter().enumerate();
    let receivers_m: Vec<[f64; 3]> = receivers
        .map(|(number, at_m)| limits.place(&format!("receiver {number}"), *at_m))
        .collect::<Result<_, _>>()?;
    let paths = Paths::new(scene, settings(scene, source_m, &receivers_m, max_order));
    let images = limits.images(source_m[2], max_order);
    let from = plan(source_m);
    let mut found = ImageSources::default();
    let mut seen: Vec<ImageSource> = Vec::new();
    for (&receiver_m, number) in receivers_m.iter().zip(0..) {
        let mut in_plan = paths.mirror_paths(from, plan(receiver_m))?;
        if from == plan(receiver_m) {
            in_plan.push(MirrorPath::default());
        }
        let combined = in_plan.iter().flat_map(|path| {
            let left = usize::from(max_order) - path.walls.len();
            let images = images.iter().filter(move |image| image.surfaces.len() <= left);
            images.map(move |image| ImageSource::new(path, image, receiver_m))
        });
        seen.extend(combined.filter(|image| image.distance_m > 0.0));
        found.add(number, &mut seen);
    }
    Ok(found)
}

/// Image of the source, visible from a receiver.
struct ImageSource {
    position_m: [f64; 3],
    distance_m: f64,
    reflectance: f64,
    surfaces: SmallVec<[u32; INLINE]>,
}

/// Number of surfaces of a path that need no allocation.
const INLINE: usize = 20;

impl ImageSource {
    /// Combines a path in the plan with an image by floor and ceiling.
    fn new(path: &MirrorPath, image: &HeightImage, receiver_m: [f64; 3]) -> Self {
        let position = plan(receiver_m) - path.run;
        let climb_m = receiver_m[2] - image.z_m;
        let length_m = path.run.length();
        let walls = path.walls.iter().map(|&(wall, at_m)| (at_m / length_m, wall));
        let levels = image.shares(climb_m).zip(image.surfaces.iter().copied());
        let mut surfaces: SmallVec<[(f64, u32); INLINE]> = walls.chain(levels).collect();
        surfaces.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self {
            position_m: [position.x, position.y, image.z_m],
            distance_m: length_m.hypot(climb_m),
            reflectance: path.gain * image.gain,
            surfaces: surfaces.into_iter().map(|(_, surface)| surface).collect(),
        }
    }
}

impl ImageSources {
    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        self.receivers.len()
    }

    /// Returns `true` if no receiver sees an image.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.receivers.is_empty()
    }

    /// Surfaces that reflect the path of an image, from the source to the receiver.
    #[must_use]
    pub fn surfaces(&self, image: usize) -> &[u32] {
        let end = self.ends.get(image).copied().unwrap_or_default();
        let from = image.checked_sub(1).and_then(|before| self.ends.get(before).copied());
        self.surfaces.get(from.unwrap_or_default()..end).unwrap_or_default()
    }

    /// Number of reflections of each path.
    #[must_use]
    pub fn orders(&self) -> Vec<u16> {
        (0..self.len()).map(|image| self.surfaces(image).len() as u16).collect()
    }

    /// Time of flight of each path at a speed of sound, seconds.
    #[must_use]
    pub fn delays_s(&self, sound_speed_m_s: f64) -> Vec<f64> {
        self.distances_m.iter().map(|distance_m| distance_m / sound_speed_m_s).collect()
    }

    /// Sound pressure of each path from a source of unit strength, without absorption in air:
    /// reflectances over `4 pi` distances, per metre.
    #[must_use]
    pub fn amplitudes(&self) -> Vec<f64> {
        let each = self.reflectances.iter().zip(&self.distances_m);
        each.map(|(reflectance, distance_m)| reflectance / (4.0 * PI * distance_m)).collect()
    }

    /// Moves the images of one more receiver into the lists, nearest first.
    fn add(&mut self, receiver: u32, images: &mut Vec<ImageSource>) {
        // Distances are positive, so their bits sort like the numbers; images are large to move.
        let distances = images.iter().map(|image| image.distance_m.to_bits());
        let mut order: Vec<(u64, usize)> = distances.zip(0..).collect();
        order.sort_unstable();
        for image in order.into_iter().filter_map(|(_, at)| images.get(at)) {
            self.receivers.push(receiver);
            self.positions_m.push(image.position_m);
            self.distances_m.push(image.distance_m);
            self.reflectances.push(image.reflectance);
            self.surfaces.extend_from_slice(&image.surfaces);
            self.ends.push(self.surfaces.len());
        }
        images.clear();
    }
}

fn plan([x, y, _]: [f64; 3]) -> DVec2 {
    DVec2::new(x, y)
}

/// Rejects what has no image sources.
fn check(scene: &Scene) -> Result<(), ImageSourceError> {
    if let Some(cylinder) = scene.cylinders.first() {
        return Err(ImageSourceError::Cylinder { id: cylinder.id.to_string() });
    }
    match scene.walls.iter().find(|wall| wall.z_m.is_some()) {
        Some(wall) => Err(ImageSourceError::LowWall { id: wall.id.to_string() }),
        None => Ok(()),
    }
}

/// Settings of a search for all mirror reflections up to an order. Each leg of a path ends at
/// walls, source or receiver, so it is no longer than the diagonal around them.
fn settings(
    scene: &Scene,
    source_m: [f64; 3],
    receivers_m: &[[f64; 3]],
    max_order: u16,
) -> PathSettings {
    let ends = scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let places = receivers_m.iter().map(|at| plan(*at)).chain([plan(source_m)]);
    let (low, high) =
        ends.chain(places).fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), point| {
            (low.min(point), high.max(point))
        });
    PathSettings {
        max_path_m: (f64::from(max_order) + 1.0) * low.distance(high),
        max_order: Some(max_order),
        floor: 0.0,
        repeated_contact_ratio: 1.0,
        unrestricted_m: 0.0,
        edge_law: None,
        double_diffraction: false,
        absorption_np_per_m: 0.0,
        wave_number_per_m: 1.0,
        sensor_z_m: None,
        tilt_rad: 0.0,
        scatter_height_rad: 0.0,
        direct: true,
    }
}
