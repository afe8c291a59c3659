//! Images of a source by floor and ceiling.

use super::ImageSourceError;
use crate::scene::{Material, Scene};

/// Floor and ceiling of a scene, if it has them.
pub(super) struct FlatLimits {
    /// Floor, then ceiling.
    levels: [Option<FlatLimit>; 2],
}

#[derive(Clone, Copy)]
struct FlatLimit {
    z_m: f64,
    gain: f64,
    surface: u32,
}

/// Image of a source by floor and ceiling.
pub(super) struct HeightImage {
    /// Height of the image, metres.
    pub(super) z_m: f64,
    /// Product of the reflectances.
    pub(super) gain: f64,
    /// Surfaces in turn, from the source.
    pub(super) surfaces: Vec<u32>,
    /// Distance from the source to its first surface, and between both, metres.
    steps_m: [f64; 2],
}

impl HeightImage {
    /// Positions of the reflections, as shares of a path that rises by `climb_m` from the image to
    /// the receiver.
    pub(super) fn shares(&self, climb_m: f64) -> impl Iterator<Item = f64> {
        let [first_m, between_m] = self.steps_m;
        (0..self.surfaces.len()).map(move |at| (first_m + at as f64 * between_m) / climb_m.abs())
    }
}

impl FlatLimits {
    pub(super) fn new(scene: &Scene) -> Self {
        let walls = scene.walls.len() as u32;
        let limit = |z_m: Option<f64>, material: &Material, surface| {
            z_m.map(|z_m| FlatLimit { z_m, gain: material.mirror_amplitude(), surface })
        };
        Self {
            levels: [
                limit(scene.floor_z_m, &scene.floor_material, walls),
                limit(scene.ceiling_z_m, &scene.ceiling_material, walls + 1),
            ],
        }
    }

    /// Returns a position, in a planar scene at height 0. It must be finite, and above the floor and
    /// below the ceiling.
    pub(super) fn place(&self, what: &str, at_m: [f64; 3]) -> Result<[f64; 3], ImageSourceError> {
        let [x_m, y_m, z_m] = at_m;
        let at_m = if self.levels.iter().all(Option::is_none) { [x_m, y_m, 0.0] } else { at_m };
        let [floor, ceiling] = self.levels;
        let is_inside = at_m.iter().all(|value| value.is_finite())
            && floor.is_none_or(|floor| z_m >= floor.z_m)
            && ceiling.is_none_or(|ceiling| z_m <= ceiling.z_m);
        match is_inside {
            true => Ok(at_m),
            false => Err(ImageSourceError::Position { what: what.to_owned(), at_m }),
        }
    }

    /// Images of a source at a height, the source itself first.
    pub(super) fn images(&self, z_m: f64, max_order: u16) -> Vec<HeightImage> {
        let (surfaces, steps_m) = (Vec::new(), [0.0; 2]);
        let mut images = vec![HeightImage { z_m, gain: 1.0, surfaces, steps_m }];
        for first in 0..2 {
            self.add_from(first, z_m, max_order, &mut images);
        }
        images
    }

    /// Adds the images of paths that one of the levels reflects first.
    fn add_from(&self, first: usize, z_m: f64, max_order: u16, images: &mut Vec<HeightImage>) {
        let between_m = match self.levels {
            [Some(floor), Some(ceiling)] => ceiling.z_m - floor.z_m,
            _ => 0.0,
        };
        let (mut image_m, mut gain, mut surfaces) = (z_m, 1.0, Vec::new());
        let mut steps_m = [0.0, between_m];
        for bounce in 0..usize::from(max_order) {
            let Some(level) = self.levels[(first + bounce) % 2] else { return };
            if bounce == 0 {
                steps_m[0] = (level.z_m - z_m).abs();
            }
            image_m = 2.0 * level.z_m - image_m;
            gain *= level.gain;
            surfaces.push(level.surface);
            images.push(HeightImage { z_m: image_m, gain, surfaces: surfaces.clone(), steps_m });
        }
    }
}
