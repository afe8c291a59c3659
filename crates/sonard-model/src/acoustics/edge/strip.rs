//! Narrow strips: free-standing walls of at most a wavelength, whose ends do not diffract
//! independently.
//!
//! A rigid strip of half-width `a` scatters by the pressure jump across it. With `t = x / a` along
//! the strip the jump is `sum b_n sqrt(1 - t^2) U_n(t)` (Chebyshev polynomials of the second kind,
//! with the correct behaviour at both ends). The boundary condition on the normal velocity, in the
//! plane-wave spectrum, then gives a small symmetric system for `kappa = k a` and a plane wave at
//! the angle `i` from the strip (Galerkin's method; Butler 1985 and others for the strip in
//! electromagnetism):
//!
//! ```text
//! sum_n I_mn X_n = 2 kappa sin i (-1)^m j_m(kappa cos i),       j_n(u) = J_{n+1}(u) / u
//! I_mn = int_0^inf sqrt(kappa^2 - u^2) j_m(u) j_n(u) du         for m + n even, else 0
//! D = pi / 2 kappa sin o sum_n X_n j_n(kappa cos o) exp(-i pi / 4) / sqrt(2 pi k)
//! ```
//!
//! with `D` the coefficient of a line source in the strip's middle, for `exp(-i omega t)`, towards
//! `o`. The limit `kappa -> 0` is `pi / 2 kappa^2 sin i sin o / sqrt(2 pi k)`, as required for a
//! thin wire.
//!
//! The solution is the complete scattered field on either side: no mirror echo and no shadow has to
//! be added. For a strip of one wavelength the far field is adequate from a few centimetres on: at
//! 3 cm the wavefront curvature over it is 0.4 rad.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use num_complex::Complex64;

use super::Aspect;

/// Number of polynomials: the truncation error is below 1e-6 up to [`MAX_WAVELENGTHS`].
const TERMS: usize = 8;

/// Maximum width of a strip, wavelengths. Above it, edge diffraction at its ends is accurate to 0.5
/// dB for head-on incidence.
pub const MAX_WAVELENGTHS: f64 = 1.0;

/// Quadrature points on either side of `kappa`, and upper limit of the integrals.
const POINTS: u32 = 300;
const LAST_U: f64 = 60.0;

/// Free-standing wall of at most a wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    width_m: f64,
    wave_number_per_m: f64,
    reflectance: f64,
    /// Inverse of `I`, with the signs of the right-hand side.
    inverse: [[Complex64; TERMS]; TERMS],
}

impl Strip {
    /// Creates a strip of a width and a reflectance at `wave_number_per_m`; `None` if it is too
    /// wide.
    #[must_use]
    pub fn new(width_m: f64, reflectance: f64, wave_number_per_m: f64) -> Option<Self> {
        let is_narrow = width_m * wave_number_per_m <= MAX_WAVELENGTHS * TAU;
        let inverse = || signed_inverse(integrals(0.5 * width_m * wave_number_per_m));
        is_narrow.then(|| Self { width_m, wave_number_per_m, reflectance, inverse: inverse() })
    }

    /// Field of the strip relative to that of a head-on rigid wall, between directions
    /// counter-clockwise from it. Absorption reduces the reflection in front but not the shadow
    /// behind.
    #[must_use]
    pub fn echo(&self, aspect: &Aspect) -> Complex64 {
        let is_in_front = aspect.in_rad.sin() * aspect.out_rad.sin() > 0.0;
        let gain = if is_in_front { self.reflectance } else { 1.0 };
        gain * self.coefficient(aspect.in_rad, aspect.out_rad) / aspect.distance_m.sqrt()
    }

    /// Scattering coefficient for `exp(+i omega t)`, between directions counter-clockwise from the
    /// strip.
    fn coefficient(&self, in_rad: f64, out_rad: f64) -> Complex64 {
        let k = self.wave_number_per_m;
        let kappa = 0.5 * k * self.width_m;
        let [from, to] = [in_rad, out_rad].map(|angle| bessel_over(kappa * angle.cos()));
        let row = |row: &[Complex64; TERMS]| row.iter().zip(&from).map(|(m, j)| m * j).sum();
        let jumps = self.inverse.iter().map(row);
        let sum: Complex64 = jumps.zip(&to).map(|(x, j): (Complex64, _)| x * j).sum();
        let scale = PI * kappa * kappa * in_rad.sin() * out_rad.sin() / (TAU * k).sqrt();
        (scale * Complex64::cis(-FRAC_PI_4) * sum).conj()
    }
}

/// Integrals `I_mn` of the module documentation, with `u = kappa sin p` below `kappa` and `u =
/// kappa cosh q` above. The static integral, `1 / (2 (n + 1))`, is subtracted first.
fn integrals(kappa: f64) -> [[Complex64; TERMS]; TERMS] {
    let mut sums = [[Complex64::ZERO; TERMS]; TERMS];
    let mut add = |u: f64, weight: Complex64| {
        let j = bessel_over(u);
        for (m, row) in sums.iter_mut().enumerate() {
            for n in (m % 2..TERMS).step_by(2) {
                row[n] += weight * (j[m] * j[n]);
            }
        }
    };
    let i = Complex64::I;
    for (p, weight) in simpson(0.5 * PI) {
        let u = kappa * p.sin();
        // Propagating waves, minus the static part.
        let wave = kappa * p.cos();
        add(u, weight * wave * (wave - i * u));
    }
    for (q, weight) in simpson((LAST_U / kappa).acosh()) {
        let u = kappa * q.cosh();
        add(u, -i * weight * kappa * (-q).exp() * kappa * q.sinh());
    }
    for (n, row) in sums.iter_mut().enumerate() {
        row[n] += i / (2.0 * (n as f64 + 1.0));
    }
    sums
}

/// Nodes and weights of Simpson's rule from 0 to `end`.
fn simpson(end: f64) -> impl Iterator<Item = (f64, f64)> {
    let step = end / f64::from(POINTS);
    (0..=POINTS).map(move |point| {
        let weight = match point {
            0 | POINTS => 1.0,
            _ if point % 2 == 1 => 4.0,
            _ => 2.0,
        };
        (step * f64::from(point), weight * step / 3.0)
    })
}

/// Inverse times the signs `(-1)^n` of the right-hand side, by elimination without pivoting: the
/// diagonal is dominant.
fn signed_inverse(mut matrix: [[Complex64; TERMS]; TERMS]) -> [[Complex64; TERMS]; TERMS] {
    let mut inverse = [[Complex64::ZERO; TERMS]; TERMS];
    for (n, row) in inverse.iter_mut().enumerate() {
        row[n] = Complex64::from(if n % 2 == 0 { 1.0 } else { -1.0 });
    }
    for pivot in 0..TERMS {
        let scale = matrix[pivot][pivot].inv();
        let own = [matrix[pivot], inverse[pivot]].map(|row| row.map(|value| value * scale));
        [matrix[pivot], inverse[pivot]] = own;
        for row in (0..TERMS).filter(|&row| row != pivot) {
            let factor = matrix[row][pivot];
            for n in 0..TERMS {
                matrix[row][n] -= factor * own[0][n];
                inverse[row][n] -= factor * own[1][n];
            }
        }
    }
    inverse
}

/// Values of `J_{n+1}(u) / u` for each term, by Miller's downward recurrence (Abramowitz and
/// Stegun, 9.12).
fn bessel_over(u: f64) -> [f64; TERMS] {
    let mut found = [0.0; TERMS];
    let size = u.abs();
    if size < 1e-4 {
        // J_1(u) = u / 2 - u^3 / 16, J_2(u) = u^2 / 8, J_3(u) = u^3 / 48
        (found[0], found[1], found[2]) = (0.5 - u * u / 16.0, u / 8.0, u * u / 48.0);
        return found;
    }
    let start = 2 * (0.75 * size.max(TERMS as f64)) as u32 + 24;
    let (mut above, mut here, mut sum) = (0.0, 1e-300, 0.0);
    for order in (1..=start).rev() {
        // `here` is J of this order, `below` of the next lower order.
        if let Some(kept) = found.get_mut(order as usize - 1) {
            *kept = here;
        }
        let below = 2.0 * f64::from(order) / size * here - above;
        (above, here) = (here, below);
        if order % 2 == 1 {
            sum += if order == 1 { below } else { 2.0 * below };
        }
        if here.abs() > 1e200 {
            (above, here, sum) = (above * 1e-200, here * 1e-200, sum * 1e-200);
            found = found.map(|kept| kept * 1e-200);
        }
    }
    let sign = |n: usize| if u < 0.0 && n % 2 == 1 { -1.0 } else { 1.0 };
    std::array::from_fn(|n| sign(n) * found[n] / (sum * size))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        acoustics::edge::{EdgeLaw, Wedge},
        geometry::DVec2,
    };

    const K: f64 = TAU * 49_400.0 / 343.2;

    #[test]
    fn bessel_matches_libm() {
        for u in [-3.1, -0.2, 1e-5, 0.03, 1.0, 3.1, 17.0, 59.0] {
            for (n, found) in bessel_over(u).into_iter().enumerate() {
                let expected = libm::jn(n as i32 + 1, u) / u;
                assert!((found - expected).abs() < 1e-12, "{n} {u}: {found} {expected}");
            }
        }
    }

    /// Width in wavelengths, angle in degrees and relative echo level; see
    /// `matches_boundary_integral`.
    const REFERENCE: [(f64, f64, f64); 18] = [
        (0.0202, 90.0, 0.000168),
        (0.0202, 60.0, 0.000126),
        (0.0202, 30.0, 0.000042),
        (0.1, 90.0, 0.004400),
        (0.1, 60.0, 0.003270),
        (0.1, 30.0, 0.001070),
        (0.25, 90.0, 0.033469),
        (0.25, 60.0, 0.023801),
        (0.25, 30.0, 0.007119),
        (0.5, 90.0, 0.110769),
        (0.5, 60.0, 0.068753),
        (0.5, 30.0, 0.015827),
        (0.75, 90.0, 0.137963),
        (0.75, 60.0, 0.065838),
        (0.75, 30.0, 0.020038),
        (1.0, 90.0, 0.159482),
        (1.0, 60.0, 0.044537),
        (1.0, 30.0, 0.029935),
    ];

    /// Echo of a strip at a range and an angle.
    fn back_from(strip: &Strip, range_m: f64, angle_deg: f64) -> Complex64 {
        let angle = angle_deg.to_radians();
        strip.echo(&Aspect { in_rad: angle, out_rad: angle, distance_m: 0.5 * range_m })
    }

    /// Boundary integral in the plane, computed for this test (Galerkin's method with 40 hat
    /// functions, refined towards the ends): relative level of the echo of a rigid strip at 0.5 m,
    /// by width in wavelengths and aspect.
    #[test]
    fn matches_boundary_integral() {
        for (wavelengths, angle_deg, expected) in REFERENCE {
            let strip = Strip::new(wavelengths * TAU / K, 1.0, K).expect("narrow");
            let found = back_from(&strip, 0.5, angle_deg).norm();
            let off_db = 20.0 * (found / expected).log10();
            assert!(off_db.abs() < 0.1, "{wavelengths} {angle_deg}: {found} {expected}");
        }
    }

    /// Limit `(pi / 2) kappa^2 sin^2 i / sqrt(2 pi k L)`: 0.14 mm at 0.5 m gives 0.00017.
    #[test]
    fn thin_wire_scales_with_width_squared() {
        for width_m in [1e-6, 1e-5, 1.4e-4] {
            let strip = Strip::new(width_m, 1.0, K).expect("narrow");
            for angle_deg in [90.0_f64, 50.0, 12.0] {
                let kappa: f64 = 0.5 * K * width_m;
                let sine = angle_deg.to_radians().sin();
                let expected = 0.5 * PI * kappa.powi(2) * sine.powi(2) / (TAU * K * 0.25).sqrt();
                let found = back_from(&strip, 0.5, angle_deg).norm();
                assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
            }
        }
    }

    /// Continuity at one wavelength with two edges and a mirror, except for edge-to-edge
    /// diffraction.
    #[test]
    fn wide_strip_matches_two_edges() {
        let (width_m, range_m) = (TAU / K, 0.5);
        let strip = Strip::new(width_m, 1.0, K).expect("narrow");
        let half_plane = Wedge { opening_rad: TAU, reflectance: [1.0; 2] };
        let source = DVec2::new(0.5 * width_m, range_m);
        let (leg_m, angle) = (source.length(), source.to_angle());
        let aspect = Aspect { in_rad: angle, out_rad: angle, distance_m: 0.5 * leg_m };
        let edge = EdgeLaw::Utd.echo(&half_plane, &aspect, K);
        let edges = 1.0 + 2.0 * edge * Complex64::cis(-2.0 * K * (leg_m - range_m));
        let exact = back_from(&strip, range_m, 90.0);
        let off_db = 20.0 * (edges.norm() / exact.norm()).log10();
        assert!((0.4..0.6).contains(&off_db), "{off_db}");
        assert!((edges / exact).arg().abs() < 0.1);
    }

    #[test]
    fn casts_a_shadow_and_is_reciprocal() {
        let strip = Strip::new(0.0069, 0.8, K).expect("narrow");
        let field =
            |in_rad: f64, out_rad: f64| strip.echo(&Aspect { in_rad, out_rad, distance_m: 0.3 });
        assert!(field(1.2, 1.2 - PI).re < -0.05, "{}", field(1.2, 1.2 - PI));
        for (a, b) in [(0.3, 2.0), (1.0, -0.4), (2.9, -2.0)] {
            assert!((field(a, b) - field(b, a)).norm() < 1e-12);
        }
    }
}
