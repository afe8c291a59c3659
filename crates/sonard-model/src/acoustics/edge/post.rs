//! Posts: thin upright cylinders, such as chair legs, with diffraction all around.
//!
//! The field of a line source near a cylinder of radius `a` is a series of cylindrical waves
//! (Bowman, Senior and Uslenghi, Electromagnetic and Acoustic Scattering by Simple Shapes, 1969,
//! section 2.2). With the surface admittance `b` relative to that of air, and for `exp(+i omega
//! t)`, the scattered field is
//!
//! ```text
//! D = -sqrt(2 / (pi k)) exp(i pi / 4) sum_n e_n T_n cos(n p) exp(-i (n^2 - 1/4) / (2 k L))
//! T_n = (J_n'(ka) - i b J_n(ka)) / (H_n'(ka) - i b H_n(ka))        e_0 = 1, else 2
//! ```
//!
//! with Hankel functions of the second kind and the angle `p` between the directions of propagation
//! before and after. `H_n(k s) H_n(k s')` of the legs to the axis is approximated by its phase at a
//! distance (Abramowitz and Stegun, 9.2.29, to the second term), which depends on the distance
//! parameter `L` alone. The error is a few percent at one radius from the surface, 0.1 % at ten.
//!
//! The series is the complete scattered field in all directions: reflection, creeping waves, and
//! the shadow, `-2 a / sqrt(lambda L)` of the sound behind the post. No mirror echo and no shadow
//! has to be added.

use std::f64::consts::{FRAC_PI_4, PI};

use num_complex::Complex64;

use super::Aspect;

/// Maximum wave number times radius of a post: 1.7 cm at 49.4 kHz.
pub const MAX_KA: f64 = 15.0;

/// Number of terms beyond `ka`, where the series decays faster than exponentially.
const TERMS_BEYOND: f64 = 12.0;

/// Precomputed scattering series of a thin upright cylinder.
#[derive(Debug, Clone, PartialEq)]
pub struct Post {
    radius_m: f64,
    wave_number_per_m: f64,
    /// Coefficients `-sqrt(2 / (pi k)) exp(i pi / 4) e_n T_n (-1)^n`.
    terms: Vec<Complex64>,
}

impl Post {
    /// Creates a post of a radius and a reflectance at `wave_number_per_m`; `None` if it is too
    /// thick.
    #[must_use]
    pub fn new(radius_m: f64, reflectance: f64, wave_number_per_m: f64) -> Option<Self> {
        let ka = wave_number_per_m * radius_m;
        let fits = 0.0 < ka && ka <= MAX_KA;
        let terms = || terms(ka, reflectance, wave_number_per_m);
        fits.then(|| Self { radius_m, wave_number_per_m, terms: terms() })
    }

    /// Path difference between the axis and the surface, metres. The envelope of a pulse travels
    /// via the surface.
    #[must_use]
    pub fn lead_m(&self, aspect: &Aspect) -> f64 {
        2.0 * self.radius_m * (0.5 * (aspect.out_rad - aspect.in_rad)).cos().abs()
    }

    /// Radius of the post, metres.
    #[must_use]
    pub const fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Field of the post relative to that of a head-on rigid wall, between directions from its axis
    /// and with the distance parameter of the legs to it.
    #[must_use]
    pub fn echo(&self, aspect: &Aspect) -> Complex64 {
        let Aspect { in_rad, out_rad, distance_m } = *aspect;
        // The backward direction has the angle 0 here, hence the signs in the terms.
        let step = Complex64::cis(out_rad - in_rad);
        let near = -0.5 / (self.wave_number_per_m * distance_m);
        let (mut turn, mut sum) = (Complex64::ONE, Complex64::ZERO);
        for (n, term) in self.terms.iter().enumerate() {
            let order = n as f64;
            sum += term * turn.re * Complex64::cis(near * (order * order - 0.25));
            turn *= step;
        }
        sum / distance_m.sqrt()
    }

    /// Upper bound of the field in all directions: the shadow behind the post, which exceeds the
    /// reflection elsewhere.
    #[must_use]
    pub fn bound(&self, distance_m: f64) -> f64 {
        self.terms.iter().map(|term| term.norm()).sum::<f64>() / distance_m.sqrt()
    }
}

fn terms(ka: f64, reflectance: f64, wave_number_per_m: f64) -> Vec<Complex64> {
    let scale = -(2.0 / (PI * wave_number_per_m)).sqrt() * Complex64::cis(FRAC_PI_4);
    let admittance = Complex64::new(0.0, (1.0 - reflectance) / (1.0 + reflectance));
    let term = |n: i32| {
        let [j, y] = [libm::jn(n, ka), libm::yn(n, ka)];
        let [j_slope, y_slope] = [slope(libm::jn, n, ka), slope(libm::yn, n, ka)];
        let boundary = |slope: Complex64, value: Complex64| slope - admittance * value;
        let ratio = boundary(j_slope.into(), j.into())
            / boundary(Complex64::new(j_slope, -y_slope), Complex64::new(j, -y));
        let weight = if n == 0 { 1.0 } else { 2.0 };
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        scale * weight * sign * ratio
    };
    let count = (ka + TERMS_BEYOND) as i32;
    // Far beyond `ka` the functions of the second kind overflow, and the terms vanish.
    (0..count).map(term).take_while(|term| term.is_finite()).collect()
}

/// Derivative of a cylinder function of integer order.
fn slope(function: fn(i32, f64) -> f64, n: i32, x: f64) -> f64 {
    if n == 0 { -function(1, x) } else { 0.5 * (function(n - 1, x) - function(n + 1, x)) }
}

/// Exact series of a rigid cylinder with Hankel functions of the legs, relative to the field of a
/// line source over both legs: the reference for posts. The legs to the axis enclose `between_rad`.
#[cfg(test)]
pub(crate) fn series(
    radius_m: f64,
    wave_number_per_m: f64,
    [there_m, back_m]: [f64; 2],
    between_rad: f64,
) -> Complex64 {
    let ka = wave_number_per_m * radius_m;
    let hankel = |n: i32, x: f64| Complex64::new(libm::jn(n, x), -libm::yn(n, x));
    let term = |n: i32| {
        let ratio = slope(libm::jn, n, ka)
            / Complex64::new(slope(libm::jn, n, ka), -slope(libm::yn, n, ka));
        let weight = if n == 0 { 1.0 } else { 2.0 };
        let wave = hankel(n, wave_number_per_m * there_m) * hankel(n, wave_number_per_m * back_m);
        -weight * ratio * wave * (f64::from(n) * between_rad).cos()
    };
    let sum: Complex64 = (0..ka as i32 + 14).map(term).sum();
    // Free field of a line source over the same length, in the far-field approximation.
    let length_m = there_m + back_m;
    let free = (2.0 / (PI * wave_number_per_m * length_m)).sqrt()
        * Complex64::cis(FRAC_PI_4 - wave_number_per_m * length_m);
    sum / free
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const K: f64 = TAU * 49_400.0 / 343.2;

    fn back(radius_m: f64, reflectance: f64, range_m: f64) -> Complex64 {
        let post = Post::new(radius_m, reflectance, K).expect("thin");
        post.echo(&Aspect { in_rad: 0.3, out_rad: 0.3, distance_m: 0.5 * range_m })
    }

    #[test]
    fn post_matches_exact_series() {
        let mut worst: f64 = 0.0;
        for radius_m in [0.002, 0.005, 0.01, 0.0165] {
            let post = Post::new(radius_m, 1.0, K).expect("thin");
            let shadow = back(radius_m, 1.0, 0.5).norm();
            for legs in [[0.3, 0.3], [0.2, 1.5], [1.0, 2.0]] {
                for step in 0..=36 {
                    let between_rad = PI * f64::from(step) / 36.0;
                    let exact = series(radius_m, K, legs, between_rad);
                    let distance_m = legs[0] * legs[1] / (legs[0] + legs[1]);
                    let aspect = Aspect { in_rad: 1.0, out_rad: 1.0 + between_rad, distance_m };
                    let off = (post.echo(&aspect) - exact).norm() / shadow.max(exact.norm());
                    worst = worst.max(off);
                }
            }
        }
        assert!(worst < 0.01, "{worst}");
        println!("posts: maximum relative error {worst:.1e}");
    }

    /// In front of a convex mirror of radius `a`, at the distance `s` from its surface, the ray
    /// tube has spread to `2 s (1 + s / a)`, compared with `2 s` for a flat one.
    #[test]
    fn thick_post_reflects_like_a_mirror() {
        for (radius_m, within) in [(0.01_f64, 0.03), (0.0165, 0.015)] {
            let gap_m: f64 = 1.0;
            let range_m = gap_m + radius_m;
            let spread = (1.0 + gap_m / radius_m).sqrt().recip();
            // The path length of a post's echo is measured to its axis.
            let mirror = spread * (range_m / gap_m).sqrt();
            let ratio = back(radius_m, 1.0, range_m).norm() / mirror;
            assert!((ratio - 1.0).abs() < within, "{radius_m}: {ratio}");
        }
    }

    /// The phase varies with frequency like that of a path via the surface, whose midpoint is `2 a
    /// sin(p / 2)` closer than the axis.
    #[test]
    fn pulse_travels_via_the_surface() {
        for radius_m in [0.008, 0.012, 0.016] {
            let field = |k: f64, out_rad: f64| {
                let post = Post::new(radius_m, 1.0, k).expect("thin");
                post.echo(&Aspect { in_rad: 0.0, out_rad, distance_m: 0.5 })
            };
            for out_rad in [0.0_f64, 0.5, 1.0, 1.5] {
                let turned = (field(1.001 * K, out_rad) / field(0.999 * K, out_rad)).arg();
                let aspect = Aspect { in_rad: 0.0, out_rad, distance_m: 0.5 };
                let lead_m = Post::new(radius_m, 1.0, K).expect("thin").lead_m(&aspect);
                // Interference with creeping waves, which increases towards the shadow.
                let delay_m = turned / (0.002 * K) - lead_m;
                assert!(delay_m.abs() < 3.2e-3, "{radius_m} {out_rad}: {delay_m}");
            }
        }
    }

    #[test]
    fn shadow_scales_with_the_width() {
        let (radius_m, distance_m) = (0.0165, 20.0);
        let post = Post::new(radius_m, 1.0, K).expect("thin");
        let behind = post.echo(&Aspect { in_rad: 0.0, out_rad: PI, distance_m });
        let expected = -2.0 * radius_m / (TAU / K * distance_m).sqrt() * Complex64::cis(FRAC_PI_4);
        // The deviation from a flat screen is about (ka)^(-2/3), 16 %.
        assert!((behind - expected).norm() < 0.2 * expected.norm(), "{behind} {expected}");
        assert!(post.bound(distance_m) >= behind.norm());
    }

    #[test]
    fn bound_is_above_the_field_in_all_directions() {
        for radius_m in [0.002, 0.01, 0.0165] {
            let post = Post::new(radius_m, 1.0, K).expect("thin");
            for distance_m in [0.05, 0.5, 5.0] {
                let field = |step: i32| {
                    let out_rad = PI * f64::from(step) / 90.0;
                    post.echo(&Aspect { in_rad: 0.0, out_rad, distance_m }).norm()
                };
                let most = (0..=90).map(field).fold(0.0, f64::max);
                let bound = post.bound(distance_m);
                assert!(
                    most <= bound && bound < 2.0 * most,
                    "{radius_m} {distance_m}: {most} {bound}"
                );
            }
        }
    }

    #[test]
    fn absorption_keeps_the_shadow() {
        let post = |reflectance| Post::new(0.015, reflectance, K).expect("thin");
        let field = |reflectance: f64, out_rad: f64| {
            post(reflectance).echo(&Aspect { in_rad: 0.0, out_rad, distance_m: 0.5 }).norm()
        };
        assert!((field(0.5, 0.0) / field(1.0, 0.0) - 0.5).abs() < 0.05);
        assert!(field(0.0, 0.0) < 0.1 * field(1.0, 0.0));
        assert!((field(0.0, PI) / field(1.0, PI) - 1.0).abs() < 0.15);
    }

    #[test]
    fn is_reciprocal_and_thin() {
        let post = Post::new(0.012, 0.8, K).expect("thin");
        for (a, b) in [(0.3, 2.0), (1.0, -0.4), (2.9, -2.0)] {
            let field = |in_rad, out_rad| post.echo(&Aspect { in_rad, out_rad, distance_m: 0.3 });
            assert!((field(a, b) - field(b, a)).norm() < 1e-12);
        }
        assert_eq!(Post::new(0.02, 1.0, K), None);
        assert_eq!(Post::new(0.0, 1.0, K), None);
    }
}
