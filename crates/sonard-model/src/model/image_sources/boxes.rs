//! Closed form for boxes: the lattice of Allen and Berkley.

use smallvec::SmallVec;

use super::{ImageSource, ImageSourceError, ImageSources};

/// A box with a corner at the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxRoom {
    /// Extent along x, y and, except for a planar room, z, metres.
    size_m: Vec<f64>,
    /// Reflectances of the surfaces, by number.
    reflectances: Vec<f64>,
}

/// Image of a source along one axis.
struct AxisImage {
    at_m: f64,
    /// Number of the cell that contains the image; its magnitude is the number of reflections.
    cell: i32,
    reflectance: f64,
}

/// Planes of a lattice that are still to be crossed along one axis, the farthest from the receiver
/// first.
struct CrossedPlanes {
    /// Surfaces at even and at odd planes.
    surfaces: [usize; 2],
    /// Cell behind the next plane, seen from the receiver; 0 when none is left.
    cell: i32,
    /// Share of the path from the receiver at plane 0, and from plane to plane.
    from: f64,
    per_cell: f64,
}

impl CrossedPlanes {
    /// Number of the next plane.
    const fn plane(&self) -> i32 {
        if self.cell > 0 { self.cell } else { self.cell + 1 }
    }

    /// Share of the path from the receiver to the next plane; negative if none is left.
    fn share(&self) -> f64 {
        if self.cell == 0 { -1.0 } else { self.from + f64::from(self.plane()) * self.per_cell }
    }

    /// Crosses the next plane, and returns its surface.
    fn take(&mut self) -> Option<u32> {
        if self.cell == 0 {
            return None;
        }
        let surface = self.surfaces[usize::from(self.plane() % 2 != 0)];
        self.cell -= self.cell.signum();
        Some(surface as u32)
    }
}

impl BoxRoom {
    /// Creates a box of `[x, y]` or `[x, y, z]` metres. Its surfaces are numbered as the walls of a
    /// counter-clockwise plan that begins at the origin, then the floor, then the ceiling: those at
    /// `y = 0`, the largest `x`, the largest `y`, `x = 0`, `z = 0` and the largest `z`.
    ///
    /// # Errors
    /// Another number of dimensions or surfaces, a size that is not positive, or a reflectance
    /// outside 0 to 1.
    pub fn new(size_m: &[f64], reflectances: &[f64]) -> Result<Self, ImageSourceError> {
        let error = |name, value, expected| Err(ImageSourceError::Box { name, value, expected });
        let count = |values: &[f64]| values.len() as f64;
        if !(2..=3).contains(&size_m.len()) {
            return error("number of dimensions", count(size_m), "2 or 3");
        }
        if reflectances.len() != 2 * size_m.len() {
            return error("number of reflectances", count(reflectances), "4 in a plan, 6 in space");
        }
        if let Some(&side_m) = size_m.iter().find(|side| !(side.is_finite() && **side > 0.0)) {
            return error("size", side_m, "a number greater than 0, in metres");
        }
        match reflectances.iter().find(|of| !(0.0..=1.0).contains(*of)) {
            Some(&reflectance) => error("reflectance", reflectance, "from 0 to 1"),
            None => Ok(Self { size_m: size_m.to_vec(), reflectances: reflectances.to_vec() }),
        }
    }

    /// Lists all images up to `max_order` reflections, as [`image_sources`](super::image_sources)
    /// does.
    ///
    /// # Errors
    /// A position outside the box.
    pub fn image_sources(
        &self,
        source_m: [f64; 3],
        receivers_m: &[[f64; 3]],
        max_order: u16,
    ) -> Result<ImageSources, ImageSourceError> {
        self.check("the source", source_m)?;
        let order = i32::from(max_order);
        let axes: Vec<Vec<AxisImage>> =
            (0..self.size_m.len()).map(|axis| self.along(axis, source_m[axis], order)).collect();
        let origin = [AxisImage { at_m: 0.0, cell: 0, reflectance: 1.0 }];
        let upright: &[AxisImage] = axes.get(2).map_or(&origin, Vec::as_slice);
        let mut found = ImageSources::default();
        let mut seen = Vec::new();
        for (&receiver_m, number) in receivers_m.iter().zip(0_u32..) {
            self.check(&format!("receiver {number}"), receiver_m)?;
            for z in upright {
                for y in &axes[1] {
                    let left = order - z.cell.abs() - y.cell.abs();
                    for x in axes[0].iter().filter(|x| x.cell.abs() <= left) {
                        seen.extend(self.image([x, y, z], receiver_m));
                    }
                }
            }
            found.add(number, &mut seen);
        }
        Ok(found)
    }

    fn check(&self, what: &str, at_m: [f64; 3]) -> Result<(), ImageSourceError> {
        let mut sides = self.size_m.iter().zip(at_m);
        match sides.all(|(side_m, at_m)| (0.0..=*side_m).contains(&at_m)) {
            true => Ok(()),
            false => Err(ImageSourceError::Position { what: what.to_owned(), at_m }),
        }
    }

    /// Numbers of the surfaces at the lower and the upper end of an axis.
    const fn surfaces(axis: usize) -> [usize; 2] {
        match axis {
            0 => [3, 1],
            1 => [0, 2],
            _ => [4, 5],
        }
    }

    /// Images along an axis: in even cells as the source, in odd cells mirrored.
    fn along(&self, axis: usize, source_m: f64, order: i32) -> Vec<AxisImage> {
        let side_m = self.size_m[axis];
        let [low, high] = Self::surfaces(axis).map(|surface| self.reflectances[surface]);
        let image = |cell: i32| {
            let is_mirrored = cell % 2 != 0;
            let at_m = if is_mirrored {
                f64::from(cell + 1) * side_m - source_m
            } else {
                f64::from(cell) * side_m + source_m
            };
            // The surface on the image's side is the first that the receiver looks through.
            let (near, far) = if cell > 0 { (high, low) } else { (low, high) };
            let count = cell.abs();
            AxisImage { at_m, cell, reflectance: near.powi((count + 1) / 2) * far.powi(count / 2) }
        };
        (-order..=order).map(image).collect()
    }

    /// Planes across an axis between the receiver, in cell 0, and an image.
    fn planes(&self, axis: usize, along: [&AxisImage; 3], receiver_m: [f64; 3]) -> CrossedPlanes {
        let AxisImage { at_m, cell, .. } = *along[axis];
        let side_m = self.size_m.get(axis).copied().unwrap_or_default();
        let run_m = at_m - receiver_m[axis];
        CrossedPlanes {
            surfaces: Self::surfaces(axis),
            cell,
            per_cell: side_m / run_m,
            from: -receiver_m[axis] / run_m,
        }
    }

    /// Image at a place along each axis; `None` at the receiver itself.
    fn image(&self, along: [&AxisImage; 3], receiver_m: [f64; 3]) -> Option<ImageSource> {
        let is_planar = self.size_m.len() == 2;
        let receiver_m = if is_planar { [receiver_m[0], receiver_m[1], 0.0] } else { receiver_m };
        let position_m = along.map(|image| image.at_m);
        let squares = position_m.iter().zip(receiver_m).map(|(a, b)| (a - b) * (a - b));
        let distance_m = squares.sum::<f64>().sqrt();
        if distance_m == 0.0 {
            return None;
        }
        let mut planes = [0, 1, 2].map(|axis| self.planes(axis, along, receiver_m));
        let mut surfaces = SmallVec::new();
        // From the source, which is the farthest from the receiver.
        while let Some(next) = planes.iter_mut().max_by(|a, b| a.share().total_cmp(&b.share())) {
            let Some(surface) = next.take() else { break };
            surfaces.push(surface);
        }
        Some(ImageSource {
            position_m,
            distance_m,
            reflectance: along.iter().map(|image| image.reflectance).product(),
            surfaces,
        })
    }
}
