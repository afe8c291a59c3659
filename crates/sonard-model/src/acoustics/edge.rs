//! Edge laws: the echo that an edge sends back.
//!
//! All laws give the echo of an edge relative to the echo that a large, rigid, head-on wall
//! would give over a path of the same length. With legs `s'` (to the edge) and `s` (from it) a
//! diffraction coefficient `D` gives `D sqrt((s + s') / (s s')) = D / sqrt(L)`, where
//! `L = s s' / (s + s')` is the distance parameter; this ratio is the same for a line source in
//! the plane as for a point source in space. For a ranger that looks straight at the edge,
//! `2 L` is the range. Time convention `exp(+i omega t)`.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use num_complex::Complex64;

pub use post::{MOST_KA, Post};
pub use strip::{MOST_WAVELENGTHS, Strip};
pub use view::EdgeView;

/// A law for the strength of the echo of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum EdgeLaw {
    /// The uniform theory of diffraction of Kouyoumjian and Pathak (1974): the level follows from
    /// the wedge's angle and the aspect, and the whole field stays continuous where a mirror
    /// echo or the edge's shadow begins.
    #[default]
    Utd,
    /// `1 / (2 pi sqrt(z / lambda))` at range `z`, whatever the aspect (Dudek, Jenkin, Milios and
    /// Wilkes, after Kuc and Siegel).
    KucSiegel,
    /// `sigma_E sqrt(r_f / r)` at range `r`, whatever the aspect (Bozma and Kuc).
    BozmaKuc {
        /// `sigma_E`: 0.035 to 0.10 for a right-angled edge.
        sigma: f64,
        /// Where the far field begins, `r_f = a^2 / lambda`, metres.
        far_field_m: f64,
    },
}

/// A wedge of air between two walls that meet, or all around a free end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wedge {
    /// Opening of the air, radians: `2 pi` around a free end, `3 pi / 2` around a box's corner,
    /// `pi / 2` in a room's corner.
    pub opening_rad: f64,
    /// Reflectance of the wall where angles in the wedge start, and of the other one.
    pub reflectance: [f64; 2],
}

/// Incidence on a wedge and departure from it: in on one leg, out on another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aspect {
    /// Direction from the edge towards the source, from the wedge's first wall, radians.
    pub in_rad: f64,
    /// Direction from the edge towards the receiver, from the wedge's first wall, radians.
    pub out_rad: f64,
    /// Distance parameter `s s' / (s + s')`, metres.
    pub distance_m: f64,
}

impl EdgeLaw {
    /// Field behind the edge relative to that of a head-on rigid wall, at `wave_number_per_m`.
    ///
    /// Laws without an aspect say nothing about concave wedges, which then give nothing, and
    /// take the geometric mean of the two reflectances.
    #[must_use]
    pub fn echo(&self, wedge: &Wedge, aspect: &Aspect, wave_number_per_m: f64) -> Complex64 {
        let range_m = 2.0 * aspect.distance_m;
        let level = match *self {
            Self::Utd => return wedge.uniform(aspect, aspect, wave_number_per_m),
            Self::KucSiegel => kuc_siegel(range_m, TAU / wave_number_per_m),
            Self::BozmaKuc { sigma, far_field_m } => bozma_kuc(range_m, sigma, far_field_m),
        };
        if !wedge.is_convex() {
            return Complex64::ZERO;
        }
        let [first, second] = wedge.reflectance;
        Complex64::from(level * (first * second).sqrt())
    }

    /// Whether a wedge sends anything back under this law.
    #[must_use]
    pub fn answers(&self, wedge: &Wedge) -> bool {
        match self {
            Self::Utd => !wedge.is_regular(),
            Self::KucSiegel | Self::BozmaKuc { .. } => wedge.is_convex(),
        }
    }

    /// An upper bound of the magnitude of [`Self::echo`], an order cheaper to get.
    #[must_use]
    pub fn bound(&self, wedge: &Wedge, aspect: &Aspect, wave_number_per_m: f64) -> f64 {
        match self {
            Self::Utd => wedge.uniform_bound(aspect, wave_number_per_m),
            _ => self.echo(wedge, aspect, wave_number_per_m).re,
        }
    }
}

/// Echo of an edge at range `range_m` relative to a plane's, at a wavelength in metres: S. Dudek,
/// Jenkin, Milios and Wilkes's rule from Kuc and Siegel. For ranges well beyond a wavelength.
#[must_use]
pub fn kuc_siegel(range_m: f64, wavelength_m: f64) -> f64 {
    1.0 / (TAU * (range_m / wavelength_m).sqrt())
}

/// Echo of an edge at range `range_m` relative to a plane's: Bozma and Kuc's amplitude of edges
/// over their amplitude of planes and corners.
#[must_use]
pub fn bozma_kuc(range_m: f64, sigma: f64, far_field_m: f64) -> f64 {
    sigma * (far_field_m / range_m).sqrt()
}

/// Openings closer than this to `pi / m` are `pi / m`, radians. Scenes hold decimal coordinates,
/// of which rounding leaves 1e-14.
const REGULAR_RAD: f64 = 1e-10;

/// Over which angle an edge fades towards an opening at which there is none, radians.
const FADES_RAD: f64 = 0.1;

/// On a boundary the edge counts as lit; this far from it at most, radians.
const ON_BOUNDARY_RAD: f64 = 1e-9;

impl Wedge {
    /// Whether mirror images alone are the exact field: an opening of `pi / m` (a flat wall, a
    /// right-angled corner, ...), which diffracts nothing. With an odd `m` both walls have to reflect alike:
    /// else the image in the last one jumps, as where two materials meet on one line.
    #[must_use]
    pub fn is_regular(&self) -> bool {
        let count = (PI / self.opening_rad).round();
        let [first, second] = self.reflectance;
        let is_even = (0.5 * count).fract() == 0.0;
        count >= 1.0
            && (self.opening_rad - PI / count).abs() < REGULAR_RAD
            && (is_even || first == second)
    }

    /// Whether the air takes up more than half a turn.
    #[must_use]
    pub fn is_convex(&self) -> bool {
        self.opening_rad > PI + REGULAR_RAD
    }

    /// Kouyoumjian and Pathak, "A uniform geometrical theory of diffraction for an edge in a
    /// perfectly conducting surface", Proc. IEEE 62 (1974), equation (25) for the hard case,
    /// over `sqrt(L)`.
    ///
    /// Each of its four cotangents belongs to one mirror image of the source in the wedge, and
    /// takes away half of that image's field where it comes into sight. It is weighed with the
    /// reflectances that made the image, so that the sum stays continuous for walls that absorb
    /// too (after Luebbers, IEEE Trans. Antennas Propag. 32, 1984). An image that comes into sight only
    /// beyond the walls is weighed so that less and less is left towards a flat wall, which diffracts nothing.
    /// Error below 1 % from half a wavelength off the edge, without multiple diffraction between near edges.
    ///
    /// Between `from` and `aspect` the coefficient runs on without the jumps that it has where an image
    /// comes into sight: the field there beside images as they are seen at `from`. The same twice
    /// gives the coefficient itself.
    fn uniform(&self, aspect: &Aspect, from: &Aspect, wave_number_per_m: f64) -> Complex64 {
        if self.is_regular() {
            return Complex64::ZERO;
        }
        let n = self.opening_rad / PI;
        let kl = wave_number_per_m * aspect.distance_m;
        let sum: Complex64 = self
            .images(aspect, from)
            .iter()
            .map(|image| image.reflectance * image.cotangent_term(n, kl))
            .sum();
        -Complex64::cis(-FRAC_PI_4) / (2.0 * n * (TAU * kl).sqrt()) * sum
    }

    /// The same with transition functions of 1, but no image's share above the half that it has
    /// at its boundary.
    fn uniform_bound(&self, aspect: &Aspect, wave_number_per_m: f64) -> f64 {
        if self.is_regular() {
            return 0.0;
        }
        let n = self.opening_rad / PI;
        let scale = 2.0 * n * (TAU * wave_number_per_m * aspect.distance_m).sqrt();
        let share = |image: &Image| {
            let far = 1.0 / (image.past_rad / (2.0 * n)).tan().abs() / scale;
            image.reflectance * far.min(0.5)
        };
        self.images(aspect, aspect).iter().map(share).sum()
    }

    /// The images whose boundaries are nearest on each side of `from`, for the source and its first
    /// image.
    fn images(&self, aspect: &Aspect, from: &Aspect) -> [Image; 4] {
        let difference = [aspect, from].map(|at| at.out_rad - at.in_rad);
        let sum = [aspect, from].map(|at| at.out_rad + at.in_rad);
        let [one, two] = self.pair(difference, [-self.opening_rad, self.opening_rad], false);
        let [three, four] = self.pair(sum, [0.0, 2.0 * self.opening_rad], true);
        [one, two, three, four]
    }

    /// The two of them at an angle `here`, as they are seen `there`, for angles within `air`.
    ///
    /// Towards an opening of `pi / m` the boundary of one leaves the air where that of the other comes in, and
    /// both images become one. So the one whose boundary is outside, where nothing asks for its strength, is given
    /// more and more of the other's.
    fn pair(&self, [here, there]: [f64; 2], air: [f64; 2], mirrored: bool) -> [Image; 2] {
        let turn = 2.0 * self.opening_rad;
        let mut outside = [0.0; 2];
        let mut images = [1.0, -1.0].map(|side| {
            let count = ((PI + side * there) / turn).round();
            let past_rad = |beta: f64| PI + side * beta - count * turn;
            let boundary = side * (count * turn - PI);
            outside[usize::from(side < 0.0)] = (air[0] - boundary).max(boundary - air[1]);
            Image {
                past_rad: past_rad(here),
                is_lit: past_rad(there) > -ON_BOUNDARY_RAD,
                reflectance: self.image_reflectance((side * count) as i32, mirrored),
            }
        });
        let own = [images[0].reflectance, images[1].reflectance];
        for (at, image) in images.iter_mut().enumerate() {
            if outside[at] > -ON_BOUNDARY_RAD && outside[1 - at] <= ON_BOUNDARY_RAD {
                let share = (outside[at] / FADES_RAD).clamp(0.0, 1.0);
                image.reflectance = own[1 - at] + share * (own[at] - own[1 - at]);
                break;
            }
        }
        images
    }

    /// Product of the reflectances for the image at `2 number opening +- in_rad` (minus: mirrored).
    fn image_reflectance(&self, number: i32, mirrored: bool) -> f64 {
        let [first, second] = self.reflectance;
        let pairs = (first * second).powi(number.abs() - i32::from(mirrored && number > 0));
        match (mirrored, number) {
            (false, _) => pairs,
            (true, 1..) => pairs * second,
            (true, _) => pairs * first,
        }
    }
}

/// A mirror image of the source in the wedge.
struct Image {
    /// Angle by which the receiver is past the boundary of the image's light, on the lit side, radians.
    past_rad: f64,
    /// Whether the image counts as seen.
    is_lit: bool,
    /// Strength of the image.
    reflectance: f64,
}

impl Image {
    /// `cot((pi +- beta) / 2n) F(k L a(beta))`, with its limit on the boundary (equations 25, 33).
    fn cotangent_term(&self, n: f64, kl: f64) -> Complex64 {
        let side = if self.is_lit { 1.0 } else { -1.0 };
        if self.past_rad.abs() < ON_BOUNDARY_RAD {
            return side * n * (TAU * kl).sqrt() * Complex64::cis(FRAC_PI_4);
        }
        let x = kl * 2.0 * (self.past_rad / 2.0).sin().powi(2);
        let cotangent = (self.past_rad / (2.0 * n)).tan().recip();
        let term = transition(x) * cotangent;
        if (self.past_rad > 0.0) == self.is_lit {
            return term;
        }
        // Past the boundary: Fresnel's integral from the other end.
        term + side * 2.0 * (PI * x).sqrt() * cotangent.abs() * Complex64::cis(FRAC_PI_4 + x)
    }
}

/// The transition function `F(x) = 2 i sqrt(x) exp(i x) int_sqrt(x)^inf exp(-i t^2) dt` of
/// Kouyoumjian and Pathak, equation (26), for `x >= 0`, to better than 1e-7.
#[must_use]
pub fn transition(x: f64) -> Complex64 {
    let ix = Complex64::new(0.0, x);
    if x < 3.0 { transition_series(x, ix) } else { transition_fraction(x, ix) }
}

/// From the power series of the error function (Abramowitz and Stegun, 7.1.6).
fn transition_series(x: f64, ix: Complex64) -> Complex64 {
    let mut term = Complex64::ONE;
    let mut sum = term;
    for odd in (3..61).step_by(2) {
        term *= 2.0 * ix / f64::from(odd);
        sum += term;
    }
    (PI * x).sqrt() * Complex64::cis(FRAC_PI_4 + x) - 2.0 * ix * sum
}

/// From the continued fraction of the complementary error function (Abramowitz and Stegun,
/// 7.1.14, in its even form): `2z^2 / (2z^2 + 1 - 1*2/(2z^2 + 5 - 3*4/(2z^2 + 9 - ...)))`.
fn transition_fraction(x: f64, ix: Complex64) -> Complex64 {
    let depth = if x > 30.0 { 5 } else { 24 };
    let mut rest = Complex64::ZERO;
    for i in (1..=depth).rev() {
        let m = f64::from(2 * i - 1);
        rest = m * (m + 1.0) / (2.0 * ix + (2.0 * m + 3.0) - rest);
    }
    2.0 * ix / (2.0 * ix + 1.0 - rest)
}

pub(crate) mod post;
mod strip;
mod view;

#[cfg(test)]
mod tests;
