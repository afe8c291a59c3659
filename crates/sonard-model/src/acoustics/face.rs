//! Transducer face as a reflector.

use num_complex::Complex64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smallvec::{SmallVec, smallvec};

/// Face and housing of a transducer as a reflector.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Face {
    /// Radius of the disc, metres.
    pub radius_m: f64,
    /// Amplitude reflection coefficient, 0 to 1.
    pub reflectance: f64,
}

/// Disc that reflects sound of one frequency.
///
/// The back does not reflect: sound from behind the face is ignored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Radius and reflectance of the disc.
    pub face: Face,
    /// Wave number `2 pi f / c`, radians per metre.
    pub wave_number_per_m: f64,
}

/// Geometry of a path that a face reflects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaceAspect {
    /// Distance from the (mirrored) source to the disc, metres.
    pub in_m: f64,
    /// Distance from the disc to the (mirrored) receiver, metres.
    pub out_m: f64,
    /// Direction towards the source, relative to the disc's axis, radians.
    pub in_rad: f64,
    /// Direction towards the receiver, relative to the disc's axis, with the same sense, radians.
    pub out_rad: f64,
}

impl Disc {
    /// Field reflected by the disc, relative to an infinite mirror in its place.
    ///
    /// Kirchhoff integral over the disc in the Fresnel approximation (Born and Wolf, Principles of
    /// Optics, section 8.8, has the same integral for a lens). From a source at `R1` and to a
    /// receiver at `R2` the path over a point at `rho a` from the centre is longer by `(rho a)^2 /
    /// 2 (1/R1 + 1/R2)`, and by `rho a (sin i + sin o) cos(phi)` to one side. With `p = k a^2 / 2
    /// (1/R1 + 1/R2)` and `q = k a |sin i + sin o|` the field is
    ///
    /// ```text
    /// F = 2 i p  integral from 0 to 1 of  J0(q rho) exp(-i p rho^2) rho d rho,
    /// ```
    ///
    /// normalized by the integral over an infinite disc, whose zones cancel except for half of the
    /// first. On the axis (`q = 0`) the field is `1 - exp(-i p)`, between zero and twice a mirror;
    /// far away it is the aperture pattern `i p 2 J1(q)/q`. Seen at an angle the disc is an
    /// ellipse. Its zones are counted by the geometric mean, `p cos`, with the mean of both cosines
    /// to preserve reciprocity.
    ///
    /// Valid for legs of at least `a`; an estimate at the rim of a disc smaller than a wavelength.
    #[must_use]
    pub fn reflection(&self, aspect: &FaceAspect) -> Complex64 {
        let (in_sin, in_cos) = aspect.in_rad.sin_cos();
        let (out_sin, out_cos) = aspect.out_rad.sin_cos();
        if in_cos <= 0.0 || out_cos <= 0.0 {
            return Complex64::ZERO;
        }
        let cosine = 0.5 * (in_cos + out_cos);
        let p = self.zone_m() * (1.0 / aspect.in_m + 1.0 / aspect.out_m) * cosine;
        let slant = in_sin + out_sin;
        let q = self.wave_number_per_m * self.face.radius_m * slant.abs();
        self.face.reflectance * zones(p, q)
    }

    /// Scattering strength with all zones in phase, metres. The maximum of [`Self::reflection`]
    /// over all aspects is this value times `1/R1 + 1/R2`.
    #[must_use]
    pub fn strength_m(&self) -> f64 {
        self.face.reflectance * self.zone_m()
    }

    /// `k a^2 / 2`.
    fn zone_m(&self) -> f64 {
        0.5 * self.wave_number_per_m * self.face.radius_m * self.face.radius_m
    }
}

/// Integral over `u = rho^2` from 0 to 1 of `J0(q sqrt(u)) exp(-i p u)`, times `i p`, by Lommel
/// functions (Born and Wolf, Principles of Optics, 8.8.1, with `u = 2 p`, `v = q`).
fn zones(p: f64, q: f64) -> Complex64 {
    if q < 1e-9 {
        return Complex64::ONE - Complex64::cis(-p);
    }
    // One series converges in the geometric shadow, the other in the illuminated region.
    let is_lit = 2.0 * p > q;
    let ratio = if is_lit { q / (2.0 * p) } else { 2.0 * p / q };
    // Sums both functions at once: U1 + i U2, or V0 + i V1, with `i^2s = (-1)^s`.
    let turn = Complex64::new(0.0, ratio);
    let (mut power, mut sum) = (Complex64::ONE, Complex64::ZERO);
    for bessel in &bessel(q)[usize::from(!is_lit)..] {
        sum += power * bessel;
        power *= turn;
    }
    if is_lit {
        Complex64::cis(0.5 * q * ratio) - Complex64::cis(-p) * sum
    } else {
        Complex64::new(0.0, ratio) * Complex64::cis(-p) * sum
    }
}

/// Bessel functions of the first kind for an argument above 0, orders 0, 1, 2 and so on until they
/// are below 1e-9. Downward recurrence, normalized by `1 = J0 + 2 (J2 + J4 + ...)` (Abramowitz and
/// Stegun, 9.1.27, 9.1.46).
fn bessel(x: f64) -> SmallVec<[f64; 40]> {
    let last = (1.2 * x) as usize + 18;
    let mut orders: SmallVec<[f64; 40]> = smallvec![0.0; last + 2];
    orders[last] = 1e-200;
    let step = 2.0 / x;
    for n in (1..=last).rev() {
        orders[n - 1] = n as f64 * step * orders[n] - orders[n + 1];
    }
    let even: f64 = orders.iter().skip(2).step_by(2).sum();
    let scale = (orders[0] + 2.0 * even).recip();
    orders.iter_mut().for_each(|order| *order *= scale);
    orders
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;

    const LAMBDA_M: f64 = 343.99 / 49_400.0;
    const FACE: Disc = Disc {
        face: Face { radius_m: 0.0215, reflectance: 1.0 },
        wave_number_per_m: TAU / LAMBDA_M,
    };

    fn head_on(in_m: f64, out_m: f64) -> FaceAspect {
        FaceAspect { in_m, out_m, in_rad: 0.0, out_rad: 0.0 }
    }

    #[test]
    fn on_axis_is_the_closed_form() {
        for (near, far) in [(0.094, 0.188), (0.5, 0.5), (3.0, 0.2)] {
            let p = PI * 0.0215_f64.powi(2) / LAMBDA_M * (1.0 / near + 1.0 / far);
            let expected = (Complex64::ONE - Complex64::cis(-p)).norm();
            let found = FACE.reflection(&head_on(near, far)).norm();
            assert!((found - expected).abs() < 1e-12, "{near} {far}");
            // The series agree with the closed form just off the axis.
            assert!((zones(p, 1e-7).norm() - expected).abs() < 1e-9, "{p}");
        }
    }

    #[test]
    fn zones_match_their_integral() {
        const RINGS: u32 = 4000;
        for p in [0.01, 0.5, 3.0, 12.0, 40.0] {
            for q in [1e-7, 0.1, 1.0, 2.0 * p, 2.000_001 * p, 8.0, 30.0, 90.0] {
                let ring = |ring: u32| {
                    let u = (f64::from(ring) + 0.5) / f64::from(RINGS);
                    libm::j0(q * u.sqrt()) * Complex64::cis(-p * u) / f64::from(RINGS)
                };
                let expected = Complex64::new(0.0, p) * (0..RINGS).map(ring).sum::<Complex64>();
                let off = (zones(p, q) - expected).norm();
                assert!(off < 2e-4 * p.max(1.0), "{p} {q}: {} for {expected}", zones(p, q));
            }
        }
    }

    #[test]
    fn far_field_is_the_aperture_pattern() {
        for degrees in [1.0_f64, 4.0, 9.0, 20.0, 60.0] {
            let theta_rad = degrees.to_radians();
            let aspect =
                FaceAspect { in_m: 1e3, out_m: 1e3, in_rad: theta_rad, out_rad: theta_rad };
            let x = FACE.wave_number_per_m * FACE.face.radius_m * 2.0 * theta_rad.sin();
            let p = FACE.zone_m() * 2e-3 * theta_rad.cos();
            let expected = p * (2.0 * libm::j1(x) / x).abs();
            assert!((FACE.reflection(&aspect).norm() - expected).abs() < 1e-6 * p, "{degrees}");
        }
    }

    /// Kirchhoff integral summed point by point over the disc, with exact distances.
    #[test]
    fn off_axis_matches_kirchhoff_sum() {
        let k = FACE.wave_number_per_m;
        for (in_m, out_m, in_deg, out_deg) in
            [(0.188, 0.188, 0.0_f64, 0.0_f64), (0.188, 0.3, 4.0, 0.0), (0.3, 0.3, 9.0, -9.0)]
        {
            let place = |length: f64, degrees: f64| {
                (length * degrees.to_radians().sin(), length * degrees.to_radians().cos())
            };
            let (source, receiver) = (place(in_m, in_deg), place(out_m, out_deg));
            let (rings, steps) = (150, 240);
            let mut sum = Complex64::ZERO;
            for ring in 0..rings {
                let rho = (f64::from(ring) + 0.5) / f64::from(rings) * FACE.face.radius_m;
                for step in 0..steps {
                    let (sin, cos) = (f64::from(step) / f64::from(steps) * TAU).sin_cos();
                    let to = |(x, z): (f64, f64)| {
                        ((x - rho * cos).powi(2) + (rho * sin).powi(2) + z * z).sqrt()
                    };
                    let (r1, r2) = (to(source), to(receiver));
                    let obliquity = 0.5 * (source.1 / r1 + receiver.1 / r2);
                    let element =
                        rho * FACE.face.radius_m / f64::from(rings) * TAU / f64::from(steps);
                    sum += obliquity * element / (r1 * r2) * Complex64::cis(-k * (r1 + r2));
                }
            }
            // An infinite mirror gives exp(-i k (R1 + R2)) / (R1 + R2).
            let mirror = TAU / k / (in_m + out_m);
            let (in_rad, out_rad) = (in_deg.to_radians(), out_deg.to_radians());
            let found = FACE.reflection(&FaceAspect { in_m, out_m, in_rad, out_rad });
            let off = (found.norm() - sum.norm() / mirror).abs();
            assert!(off < 0.02, "{in_m} {in_deg} {out_deg}: {found} for {}", sum.norm() / mirror);
        }
    }

    #[test]
    fn is_reciprocal_and_one_sided() {
        let aspect = FaceAspect { in_m: 0.2, out_m: 0.7, in_rad: 0.3, out_rad: -0.1 };
        let back = FaceAspect { in_m: 0.7, out_m: 0.2, in_rad: -0.1, out_rad: 0.3 };
        assert!((FACE.reflection(&aspect) - FACE.reflection(&back)).norm() < 1e-12);
        let behind = FaceAspect { in_rad: 2.0, ..aspect };
        assert_eq!(FACE.reflection(&behind), Complex64::ZERO);
    }
}
