//! Diffraction laws: the echo of an edge.
//!
//! All laws give the echo of an edge relative to that of a large, rigid, head-on wall over a path
//! of the same length. With legs `s'` (to the edge) and `s` (from it) a diffraction coefficient `D`
//! gives `D sqrt((s + s') / (s s')) = D / sqrt(L)`, where `L = s s' / (s + s')` is the distance
//! parameter. This ratio is the same for a line source in the plane as for a point source in space.
//! For a ranger that points at the edge, `2 L` is the range. Time convention `exp(+i omega t)`.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use num_complex::Complex64;

pub use images::LitImages;
use images::WedgeImage;
pub use post::{MAX_KA, Post};
pub use strip::{MAX_WAVELENGTHS, Strip};
pub use view::EdgeView;

/// Law for the echo amplitude of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum EdgeLaw {
    /// Uniform theory of diffraction of Kouyoumjian and Pathak (1974). The amplitude follows from
    /// the wedge's angle and the aspect; the total field is continuous at reflection and shadow
    /// boundaries.
    #[default]
    Utd,
    /// Amplitude `1 / (2 pi sqrt(z / lambda))` at range `z`, independent of aspect (Dudek, Jenkin,
    /// Milios and Wilkes, after Kuc and Siegel).
    KucSiegel,
    /// Amplitude `sigma_E sqrt(r_f / r)` at range `r`, independent of aspect (Bozma and Kuc).
    BozmaKuc {
        /// Edge constant `sigma_E`: 0.035 to 0.10 for a right-angled edge.
        sigma: f64,
        /// Start of the far field, `r_f = a^2 / lambda`, metres.
        far_field_m: f64,
    },
}

/// Wedge of air between two walls with a common edge, or around a free end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wedge {
    /// Opening angle of the air, radians: `2 pi` around a free end, `3 pi / 2` around a box's
    /// corner, `pi / 2` in a room's corner.
    pub opening_rad: f64,
    /// Reflectance of the wall from which angles are measured, and of the second wall.
    pub reflectance: [f64; 2],
}

/// Directions of incidence on a wedge and of departure from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aspect {
    /// Direction from the edge towards the source, measured from the wedge's first wall, radians.
    pub in_rad: f64,
    /// Direction from the edge towards the receiver, measured from the wedge's first wall, radians.
    pub out_rad: f64,
    /// Distance parameter `s s' / (s + s')`, metres.
    pub distance_m: f64,
}

impl EdgeLaw {
    /// Field diffracted by the edge relative to that of a head-on rigid wall, at
    /// `wave_number_per_m`.
    ///
    /// Aspect-independent laws do not cover concave wedges, which give zero, and use the geometric
    /// mean of the two reflectances.
    #[must_use]
    pub fn echo(&self, wedge: &Wedge, aspect: &Aspect, wave_number_per_m: f64) -> Complex64 {
        let range_m = 2.0 * aspect.distance_m;
        let level = match *self {
            Self::Utd => {
                let lit = wedge.lit_images(aspect);
                return self.echo_beside(wedge, aspect, lit, wave_number_per_m);
            }
            Self::KucSiegel => kuc_siegel(range_m, TAU / wave_number_per_m),
            Self::BozmaKuc { sigma, far_field_m } => bozma_kuc(range_m, sigma, far_field_m),
        };
        if !wedge.is_convex() {
            return Complex64::ZERO;
        }
        let [first, second] = wedge.reflectance;
        Complex64::from(level * (first * second).sqrt())
    }

    /// Field diffracted by the edge as [`Self::echo`] returns it, for a search that found the images
    /// `lit`. Laws without an aspect ignore them.
    pub(crate) fn echo_beside(
        &self,
        wedge: &Wedge,
        aspect: &Aspect,
        lit: LitImages,
        wave_number_per_m: f64,
    ) -> Complex64 {
        match self {
            Self::Utd => wedge.uniform(aspect, aspect, lit, wave_number_per_m),
            _ => self.echo(wedge, aspect, wave_number_per_m),
        }
    }

    /// Returns `true` if a wedge has an echo under this law.
    #[must_use]
    pub fn diffracts(&self, wedge: &Wedge) -> bool {
        match self {
            Self::Utd => !wedge.is_regular(),
            Self::KucSiegel | Self::BozmaKuc { .. } => wedge.is_convex(),
        }
    }

    /// Upper bound of the magnitude of [`Self::echo`], an order of magnitude cheaper to compute.
    #[must_use]
    pub fn bound(&self, wedge: &Wedge, aspect: &Aspect, wave_number_per_m: f64) -> f64 {
        match self {
            Self::Utd => wedge.uniform_bound(aspect, wave_number_per_m),
            _ => self.echo(wedge, aspect, wave_number_per_m).re,
        }
    }
}

/// Echo of an edge relative to a plane's, at range `range_m` and a wavelength in metres: rule of S.
/// Dudek, Jenkin, Milios and Wilkes from Kuc and Siegel. Valid for ranges well beyond a wavelength.
#[must_use]
pub fn kuc_siegel(range_m: f64, wavelength_m: f64) -> f64 {
    1.0 / (TAU * (range_m / wavelength_m).sqrt())
}

/// Echo of an edge relative to a plane's, at range `range_m`: Bozma and Kuc's amplitude of edges
/// over that of planes and corners.
#[must_use]
pub fn bozma_kuc(range_m: f64, sigma: f64, far_field_m: f64) -> f64 {
    sigma * (far_field_m / range_m).sqrt()
}

/// Tolerance for an opening of `pi / m`, radians. Scenes hold decimal coordinates, whose rounding
/// errors are about 1e-14. At 50 m the images of such a corner are within a nanometre of one, so
/// that a search for mirror images finds each of them.
const REGULAR_RAD: f64 = 1e-11;

impl Wedge {
    /// Returns `true` if mirror images alone are the exact field: an opening of `pi / m` (flat
    /// wall, right-angled corner, ...), which does not diffract. For odd `m` both reflectances have
    /// to be equal. Otherwise the last image is discontinuous, as at the joint of two materials on
    /// one line.
    #[must_use]
    pub fn is_regular(&self) -> bool {
        let count = (PI / self.opening_rad).round();
        let [first, second] = self.reflectance;
        let is_even = (0.5 * count).fract() == 0.0;
        count >= 1.0
            && (self.opening_rad - PI / count).abs() < REGULAR_RAD
            && (is_even || first == second)
    }

    /// Returns `true` if the opening of the air exceeds half a turn.
    #[must_use]
    pub fn is_convex(&self) -> bool {
        self.opening_rad > PI + REGULAR_RAD
    }

    /// Uniform diffraction coefficient over `sqrt(L)`: Kouyoumjian and Pathak, "A uniform
    /// geometrical theory of diffraction for an edge in a perfectly conducting surface", Proc. IEEE
    /// 62 (1974), equation (25) for the hard case.
    ///
    /// Each of the four cotangents belongs to one mirror image of the source in the wedge and
    /// cancels half of that image's field at its boundary. The weights are the reflectances that
    /// produce the image, so that the sum is continuous for absorbing walls too (after Luebbers,
    /// IEEE Trans. Antennas Propag. 32, 1984). An image whose boundary is beyond the walls is faded
    /// out towards a flat wall, which does not diffract. Error below 1 % from half a wavelength off
    /// the edge, without multiple diffraction between near edges.
    ///
    /// Between `from` and `aspect` the coefficient is continued without its jumps at image
    /// boundaries: it complements the images that are `lit` at `from`. With both arguments equal it
    /// is the coefficient itself.
    fn uniform(
        &self,
        aspect: &Aspect,
        from: &Aspect,
        lit: LitImages,
        wave_number_per_m: f64,
    ) -> Complex64 {
        if self.is_regular() {
            return Complex64::ZERO;
        }
        let n = self.opening_rad / PI;
        let kl = wave_number_per_m * aspect.distance_m;
        let term = |(image, is_lit): (&WedgeImage, bool)| {
            image.reflectance * image.cotangent_term(n, kl, is_lit)
        };
        let sum: Complex64 = self.images(aspect, from).iter().zip(lit.0).map(term).sum();
        -Complex64::cis(-FRAC_PI_4) / (2.0 * n * (TAU * kl).sqrt()) * sum
    }

    /// Upper bound of [`Self::uniform`]: transition functions of 1, and no image's share above its
    /// half on the boundary.
    fn uniform_bound(&self, aspect: &Aspect, wave_number_per_m: f64) -> f64 {
        if self.is_regular() {
            return 0.0;
        }
        let n = self.opening_rad / PI;
        let scale = 2.0 * n * (TAU * wave_number_per_m * aspect.distance_m).sqrt();
        let share = |image: &WedgeImage| {
            let far = 1.0 / (image.past_rad / (2.0 * n)).tan().abs() / scale;
            image.reflectance * far.min(0.5)
        };
        self.images(aspect, aspect).iter().map(share).sum()
    }
}

/// Transition function `F(x) = 2 i sqrt(x) exp(i x) int_sqrt(x)^inf exp(-i t^2) dt` of Kouyoumjian
/// and Pathak, equation (26), for `x >= 0`. Error below 1e-7.
#[must_use]
pub fn transition(x: f64) -> Complex64 {
    let ix = Complex64::new(0.0, x);
    if x < 3.0 { transition_series(x, ix) } else { transition_fraction(x, ix) }
}

/// Power series of the error function (Abramowitz and Stegun, 7.1.6).
fn transition_series(x: f64, ix: Complex64) -> Complex64 {
    let mut term = Complex64::ONE;
    let mut sum = term;
    for odd in (3..61).step_by(2) {
        term *= 2.0 * ix / f64::from(odd);
        sum += term;
    }
    (PI * x).sqrt() * Complex64::cis(FRAC_PI_4 + x) - 2.0 * ix * sum
}

/// Continued fraction of the complementary error function (Abramowitz and Stegun, 7.1.14, in its
/// even form): `2z^2 / (2z^2 + 1 - 1*2/(2z^2 + 5 - 3*4/(2z^2 + 9 - ...)))`.
fn transition_fraction(x: f64, ix: Complex64) -> Complex64 {
    let depth = if x > 30.0 { 5 } else { 24 };
    let mut rest = Complex64::ZERO;
    for i in (1..=depth).rev() {
        let m = f64::from(2 * i - 1);
        rest = m * (m + 1.0) / (2.0 * ix + (2.0 * m + 3.0) - rest);
    }
    2.0 * ix / (2.0 * ix + 1.0 - rest)
}

mod images;
pub(crate) mod post;
mod strip;
mod view;

#[cfg(test)]
mod tests;
