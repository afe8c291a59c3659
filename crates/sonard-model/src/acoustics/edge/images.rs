//! Mirror images of a source in a wedge, whose boundaries its diffraction makes continuous.

use std::{
    cmp::Ordering,
    f64::consts::{FRAC_PI_4, PI, TAU},
    ops::RangeInclusive,
};

use num_complex::Complex64;
use smallvec::SmallVec;

use super::{Aspect, Wedge, transition};

/// Angle over which an edge fades towards an opening without diffraction, radians.
const FADE_RAD: f64 = 0.1;

/// Tolerance of a boundary, radians; on the boundary an image counts as lit.
pub(super) const ON_BOUNDARY_RAD: f64 = 1e-9;

/// Number of images of a wedge whose boundaries may be near: two of the source, two of its mirror
/// image.
const IMAGES: usize = 4;

/// Images of a wedge that count as visible.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LitImages(pub(super) [bool; IMAGES]);

impl LitImages {
    /// Returns the images of the reversed path: source and receiver exchanged, the images on one
    /// side of the source's direction become those on the other.
    #[must_use]
    pub const fn reversed(self) -> Self {
        let [low, high, mirrored_low, mirrored_high] = self.0;
        Self([high, low, mirrored_low, mirrored_high])
    }
}

impl Wedge {
    /// Images that are visible from an aspect, boundaries included.
    #[must_use]
    pub fn lit_images(&self, aspect: &Aspect) -> LitImages {
        LitImages(self.images(aspect, aspect).map(|image| image.past_rad > -ON_BOUNDARY_RAD))
    }

    /// Images that count as visible from an aspect if a search for mirror images found those within
    /// `near_rad` of their boundary with a total amplitude `found`, relative to a perfect mirror's.
    ///
    /// On a boundary a search has tolerances of its own, and images that coincide may be found as
    /// one. The field of edge and images is continuous only if both agree on what is visible. Of
    /// the images with a number of reflections in `orders`, which the search covers, those are
    /// chosen whose sum is nearest to `found`.
    pub(crate) fn lit_as_found(
        &self,
        aspect: &Aspect,
        near_rad: f64,
        orders: &RangeInclusive<u32>,
        found: impl FnOnce() -> f64,
    ) -> LitImages {
        let LitImages(mut lit) = self.lit_images(aspect);
        let images = self.images(aspect, aspect);
        let is_near =
            |image: &WedgeImage| image.past_rad.abs() < near_rad && orders.contains(&image.order);
        let near: SmallVec<[usize; IMAGES]> =
            (0..IMAGES).filter(|&at| is_near(&images[at])).collect();
        if near.is_empty() {
            return LitImages(lit);
        }
        let found = found();
        let chosen = |number: u32| {
            near.iter().enumerate().map(move |(bit, at)| (*at, number >> bit & 1 == 1))
        };
        let off = |number: u32| {
            let sum: f64 = chosen(number)
                .filter(|(_, is_lit)| *is_lit)
                .map(|(at, _)| images[at].reflectance)
                .sum();
            let changed = chosen(number).filter(|&(at, is_lit)| lit[at] != is_lit).count();
            ((sum - found).abs(), changed)
        };
        let best = (0..1 << near.len()).min_by(|&a, &b| compare(off(a), off(b)));
        for (at, is_lit) in chosen(best.unwrap_or_default()) {
            lit[at] = is_lit;
        }
        LitImages(lit)
    }

    /// The images with the nearest boundaries on each side of `from`, for the source and its first
    /// image.
    pub(super) fn images(&self, aspect: &Aspect, from: &Aspect) -> [WedgeImage; 4] {
        let difference = [aspect, from].map(|at| at.out_rad - at.in_rad);
        let sum = [aspect, from].map(|at| at.out_rad + at.in_rad);
        let [direct_low, direct_high] =
            self.pair(difference, [-self.opening_rad, self.opening_rad], false);
        let [mirrored_low, mirrored_high] = self.pair(sum, [0.0, 2.0 * self.opening_rad], true);
        [direct_low, direct_high, mirrored_low, mirrored_high]
    }

    /// Two adjacent images at an angle `here`, those with the nearest boundaries at `there`, for
    /// angles within `air`.
    ///
    /// Towards an opening of `pi / m` the boundary of one image leaves the air where the other's
    /// enters, and both images coincide. The strength of the image with the outside boundary, which
    /// has no physical meaning there, is therefore faded to the strength of the other.
    fn pair(&self, [here, there]: [f64; 2], air: [f64; 2], mirrored: bool) -> [WedgeImage; 2] {
        let turn = 2.0 * self.opening_rad;
        let mut outside = [0.0; 2];
        let mut images = [1.0, -1.0].map(|side| {
            let count = ((PI + side * there) / turn).round();
            let past_rad = |beta: f64| PI + side * beta - count * turn;
            let boundary = side * (count * turn - PI);
            outside[usize::from(side < 0.0)] = (air[0] - boundary).max(boundary - air[1]);
            WedgeImage {
                past_rad: past_rad(here),
                reflectance: self.image_reflectance((side * count) as i32, mirrored),
                order: reflections((side * count) as i32, mirrored),
            }
        });
        let own = [images[0].reflectance, images[1].reflectance];
        for (at, image) in images.iter_mut().enumerate() {
            if outside[at] > -ON_BOUNDARY_RAD && outside[1 - at] <= ON_BOUNDARY_RAD {
                let share = (outside[at] / FADE_RAD).clamp(0.0, 1.0);
                image.reflectance = own[1 - at] + share * (own[at] - own[1 - at]);
                break;
            }
        }
        images
    }

    /// Product of the reflectances for the image at `2 number opening +- in_rad` (minus: mirrored).
    pub(super) fn image_reflectance(&self, number: i32, mirrored: bool) -> f64 {
        let [first, second] = self.reflectance;
        let pairs = (first * second).powi(number.abs() - i32::from(mirrored && number > 0));
        match (mirrored, number) {
            (false, _) => pairs,
            (true, 1..) => pairs * second,
            (true, _) => pairs * first,
        }
    }
}

/// Number of reflections at the wedge's walls that produce an image; see
/// [`Wedge::image_reflectance`].
fn reflections(number: i32, mirrored: bool) -> u32 {
    let pairs = 2 * number.unsigned_abs();
    match (mirrored, number) {
        (false, _) => pairs,
        (true, 1..) => pairs - 1,
        (true, _) => pairs + 1,
    }
}

/// Order of choices: by the deviation of the amplitude, then by the number of changed images.
fn compare(a: (f64, usize), b: (f64, usize)) -> Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

/// Mirror image of the source in the wedge.
pub(super) struct WedgeImage {
    /// Angle of the receiver past the boundary of the image's lit region, positive on the lit side,
    /// radians.
    pub(super) past_rad: f64,
    /// Product of the reflectances.
    pub(super) reflectance: f64,
    /// Number of reflections at the wedge's walls.
    order: u32,
}

impl WedgeImage {
    /// Cotangent term `cot((pi +- beta) / 2n) F(k L a(beta))`, with its limit on the boundary
    /// (equations 25, 33).
    pub(super) fn cotangent_term(&self, n: f64, kl: f64, is_lit: bool) -> Complex64 {
        let side = if is_lit { 1.0 } else { -1.0 };
        if self.past_rad.abs() < ON_BOUNDARY_RAD {
            return side * n * (TAU * kl).sqrt() * Complex64::cis(FRAC_PI_4);
        }
        let x = kl * 2.0 * (self.past_rad / 2.0).sin().powi(2);
        let cotangent = (self.past_rad / (2.0 * n)).tan().recip();
        let term = transition(x) * cotangent;
        if (self.past_rad > 0.0) == is_lit {
            return term;
        }
        // Beyond the boundary: Fresnel integral from the opposite end.
        term + side * 2.0 * (PI * x).sqrt() * cotangent.abs() * Complex64::cis(FRAC_PI_4 + x)
    }
}
