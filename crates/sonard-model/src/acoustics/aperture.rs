//! Full aperture response: every point of the face transmits to every point of it.
//!
//! A beam pattern gives the amplitude of a steady tone at an angle. Off the axis a pulse reaches
//! the near rim of the face first. It therefore begins earlier and weaker than the pattern
//! predicts, and in a null of the pattern its beginning and end are still detectable.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::{Aperture, EchoShape, Gain, Sensor, edge::EdgeView};

/// Quadrature points across a face: sufficient for a phase range of 40 radians.
const POINTS: usize = 24;

/// Quadrature points along a disc's chords: sufficient for five radians.
const HEIGHT_POINTS: usize = 8;

/// Truncation of the band on each side of the carrier, in standard deviations.
const BAND_SIGMAS: f64 = 4.0;

/// Sample spacing of the responses, microseconds.
const STEP_US: f64 = 2.0;

/// Response of the whole face, transmitting and receiving, to the sensor's own pulse.
///
/// Summed point by point with the wavefront curvature at finite range (Fresnel approximation),
/// which fills the nulls of the pattern at ranges below some tens of `a^2 / lambda`. Well beyond
/// those ranges a disc follows Kuc and Siegel: [`kuc_siegel_response`](super::kuc_siegel_response)
/// of departure and of arrival, both convolved with the pulse. The curvature due to a disc's height
/// is evaluated at the carrier frequency.
#[derive(Debug, Clone)]
pub struct ApertureResponse {
    aperture: Aperture,
    half_width_m: f64,
    /// Position across the face, metres, and weight.
    points: Vec<(f64, f64)>,
    /// Spectrum of the pulse: offset from the carrier, hertz, and amplitude.
    lines: Vec<(f64, Complex64)>,
    carrier_hz: f64,
    sound_speed_m_s: f64,
    first_us: f64,
    samples: usize,
    /// Peak of a head-on wall at 1 m before scaling, including the gain increase during the echo.
    head_on: f64,
}

/// Incidence of an echo on the face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incidence {
    /// Departure direction relative to the axis, radians, counter-clockwise.
    pub leaving_rad: f64,
    /// Direction of arrival relative to the axis, radians, counter-clockwise.
    pub arriving_rad: f64,
    /// Round-trip length of the path, metres.
    pub length_m: f64,
    /// Image of the face over the path.
    pub image: Image,
}

/// Image of the face as formed by the path of an echo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Image {
    /// Even number of mirror reflections: not reversed.
    Upright,
    /// Odd number of mirror reflections: left and right swapped.
    Swapped,
    /// Point scatterer: the image does not depend on the point of departure.
    PointScatterer,
    /// Edge diffraction: independent of the point of departure, but with an aspect that varies
    /// across the face.
    Diffracted(EdgeView),
}

impl ApertureResponse {
    /// Creates the response of a sensor for a speed of sound in m/s; `None` for an aperture that is
    /// defined only by its beam.
    #[must_use]
    pub fn new(sensor: &Sensor, sound_speed_m_s: f64) -> Option<Self> {
        let aperture = sensor.aperture.clone();
        if let Aperture::Piston { skirts_db: Some(_), .. } = aperture {
            return None;
        }
        let points = points(&aperture, POINTS)?;
        let pulse = EchoShape::for_sensor(sensor);
        let crossing_us = 2e6 * sensor.half_width_m() / sound_speed_m_s;
        let first_us = pulse.first_us() - crossing_us;
        let last_us = pulse.last_us() + crossing_us;
        let mut response = Self {
            aperture,
            half_width_m: sensor.half_width_m(),
            points,
            lines: spectrum(sensor, &pulse, 1.1 * (last_us - first_us)),
            carrier_hz: sensor.frequency_hz,
            sound_speed_m_s,
            first_us,
            samples: ((last_us - first_us) / STEP_US).ceil() as usize + 1,
            head_on: 1.0,
        };
        let head_on =
            Incidence { leaving_rad: 0.0, arriving_rad: 0.0, length_m: 2.0, image: Image::Swapped };
        let exponent = match sensor.gain {
            Gain::Compensating { exponent, .. } => exponent,
            Gain::Steps { .. } => 0.0,
        };
        let reference_us = 2e6 / sound_speed_m_s;
        response.head_on = response
            .echo(&head_on)?
            .samples()
            .map(|(t_us, sample)| sample.norm() * (1.0 + t_us / reference_us).powf(exponent))
            .fold(0.0, f64::max);
        Some(response)
    }

    /// Echo for an incidence on the face. A head-on wall at 1 m has a peak of 1. `None` if nothing
    /// leaves or arrives.
    #[must_use]
    pub fn echo(&self, incidence: &Incidence) -> Option<EchoShape> {
        let Incidence { leaving_rad, arriving_rad, .. } = *incidence;
        let gain = self.aperture.obliquity(leaving_rad) * self.aperture.obliquity(arriving_rad);
        if gain == 0.0 {
            return None;
        }
        let lead_m = self.leads_m(incidence);
        let mut samples = vec![Complex64::ZERO; self.samples];
        for &(above_hz, strength) in &self.lines {
            let k = TAU * (self.carrier_hz + above_hz) / self.sound_speed_m_s;
            let face: Complex64 =
                lead_m.iter().map(|&(lead_m, share)| share * Complex64::cis(k * lead_m)).sum();
            let omega = TAU * 1e-6 * above_hz;
            let turn = Complex64::cis(omega * STEP_US);
            let mut wave =
                gain / self.head_on * strength * face * Complex64::cis(omega * self.first_us);
            for sample in &mut samples {
                *sample += wave;
                wave *= turn;
            }
        }
        Some(EchoShape::from_samples(self.first_us, STEP_US, samples))
    }

    /// Maximum extension of an off-axis echo at either end relative to one on the axis,
    /// microseconds.
    pub(super) fn crossing_us(&self) -> f64 {
        2e6 * self.half_width_m / self.sound_speed_m_s
    }

    /// Path shortening of each pair of points, metres, and its weight.
    ///
    /// Where the path separates into departure and arrival (no curvature, or an edge in between) a
    /// grid of delays would suffice; the pairs are few enough for direct summation.
    fn leads_m(&self, incidence: &Incidence) -> Vec<(f64, Complex64)> {
        let Incidence { leaving_rad, arriving_rad, length_m, image } = *incidence;
        let bend_m = |x: f64, y: f64| match image {
            Image::Upright => (x + y).powi(2) / (2.0 * length_m),
            Image::Swapped => (x - y).powi(2) / (2.0 * length_m),
            Image::PointScatterer => (x * x + y * y) / length_m,
            Image::Diffracted(edge) => edge.curvature_m(x, y),
        };
        let shares = match image {
            Image::Diffracted(edge) => Some(edge.relative_field()),
            _ => None,
        };
        let edge_share =
            |x: f64, y: f64| shares.as_ref().map_or(Complex64::ONE, |share| share(x, y));
        let heights = self.heights(length_m);
        let mut leads = Vec::with_capacity(self.points.len() * self.points.len());
        for (&(u, share_u), heights) in self.points.iter().zip(&heights) {
            for (&(v, share_v), height) in self.points.iter().zip(heights) {
                let (x, y) = (u * leaving_rad.cos(), v * arriving_rad.cos());
                let lead_m = u * leaving_rad.sin() + v * arriving_rad.sin() - bend_m(x, y);
                leads.push((lead_m, share_u * share_v * edge_share(x, y) * height));
            }
        }
        leads
    }

    /// Height factor of each pair of chords of a disc over a path of `length_m`: the mean of
    /// `exp(-i k (z - z')^2 / (2 L))` over both chords.
    fn heights(&self, length_m: f64) -> Vec<Vec<Complex64>> {
        let count = self.points.len();
        let Aperture::Piston { radius_m, .. } = self.aperture else {
            return vec![vec![Complex64::ONE; count]; count];
        };
        let bend = PI * self.carrier_hz / self.sound_speed_m_s / length_m;
        let nodes = gauss_legendre(HEIGHT_POINTS);
        let between = |a_m: f64, b_m: f64| -> Complex64 {
            let pairs = nodes.iter().flat_map(|a| nodes.iter().map(move |b| (a, b)));
            let part = |(&(a_z, a_share), &(b_z, b_share)): (&(f64, f64), &(f64, f64))| {
                let apart_m = a_m * a_z - b_m * b_z;
                0.25 * a_share * b_share * Complex64::cis(-bend * apart_m * apart_m)
            };
            pairs.map(part).sum()
        };
        let halves: Vec<f64> = self
            .points
            .iter()
            .map(|(u, _)| (radius_m * radius_m - u * u).max(0.0).sqrt())
            .collect();
        // Chords left and right of the middle are equal.
        let half = count.div_ceil(2);
        let row = |i: usize| -> Vec<Complex64> {
            let part: Vec<_> = (0..half).map(|j| between(halves[i], halves[j])).collect();
            (0..count).map(|j| part[j.min(count - 1 - j)]).collect()
        };
        let rows: Vec<_> = (0..half).map(row).collect();
        (0..count).map(|i| rows[i.min(count - 1 - i)].clone()).collect()
    }
}

/// Spectral lines of the pulse, spaced `1 / period` over its band.
fn spectrum(sensor: &Sensor, pulse: &EchoShape, period_us: f64) -> Vec<(f64, Complex64)> {
    let band_hz = BAND_SIGMAS * sensor.pulse.bandwidth_hz();
    let spacing_hz = 1e6 / period_us;
    let each_side = (band_hz / spacing_hz).ceil() as i32;
    (-each_side..=each_side)
        .map(|i| {
            let above_hz = f64::from(i) * spacing_hz;
            let turn = |t_us: f64| Complex64::cis(-TAU * 1e-6 * above_hz * t_us);
            let sum: Complex64 = pulse.samples().map(|(t_us, sample)| sample * turn(t_us)).sum();
            (above_hz, sum * pulse.step_us() / period_us)
        })
        .collect()
}

/// Quadrature points across a face, metres from its middle, and their weights; `None` for an
/// aperture that is defined only by its beam.
pub(super) fn points(aperture: &Aperture, count: usize) -> Option<Vec<(f64, f64)>> {
    match *aperture {
        Aperture::Piston { radius_m, .. } => {
            // Chords shorten towards the rim: Gauss-Chebyshev quadrature of the second kind has
            // their weight `sqrt(1 - s^2)`.
            let angle = |i: usize| PI * i as f64 / (count + 1) as f64;
            let share = |i: usize| 2.0 * angle(i).sin().powi(2) / (count + 1) as f64;
            Some((1..=count).map(|i| (radius_m * angle(i).cos(), share(i))).collect())
        }
        Aperture::Line { half_length_m, .. } => {
            let scaled = |(place, weight): (f64, f64)| (half_length_m * place, 0.5 * weight);
            Some(gauss_legendre(count).into_iter().map(scaled).collect())
        }
        Aperture::Gaussian { .. } | Aperture::Table { .. } => None,
    }
}

/// Nodes in [-1, 1] and weights that integrate polynomials of degree `2 count - 1`, by Newton's
/// iteration on the Legendre polynomial (Abramowitz and Stegun, 25.4.29).
fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..8 {
            let (mut last, mut here) = (1.0, x);
            for n in 2..=count {
                let n = n as f64;
                (last, here) = (here, ((2.0 * n - 1.0) * x * here - (n - 1.0) * last) / n);
            }
            slope = count as f64 * (x * here - last) / (x * x - 1.0);
            x -= here / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acoustics::kuc_siegel_response;

    const SPEED_M_S: f64 = 343.2;

    fn preset(name: &str) -> Sensor {
        Sensor::preset(name).expect("a preset")
    }

    fn far(leaving_rad: f64, arriving_rad: f64) -> Incidence {
        Incidence { leaving_rad, arriving_rad, length_m: 1e6, image: Image::Upright }
    }

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        for count in [2, 5, 24] {
            for power in 0..2 * count as i32 {
                let sum: f64 =
                    gauss_legendre(count).iter().map(|(x, weight)| weight * x.powi(power)).sum();
                let exact = if power % 2 == 1 { 0.0 } else { 2.0 / f64::from(power + 1) };
                assert!((sum - exact).abs() < 1e-12, "{count} {power}: {sum}");
            }
        }
    }

    #[test]
    fn on_axis_echo_is_the_pulse() {
        for name in ["senscomp-6500", "fullwave-line"] {
            let sensor = preset(name);
            let response = ApertureResponse::new(&sensor, SPEED_M_S).expect("a face");
            let pulse = EchoShape::for_sensor(&sensor);
            let echo = response.echo(&far(0.0, 0.0)).expect("an echo");
            for i in -100..440 {
                let t_us = f64::from(i);
                let error = (echo.at(t_us) / echo.peak() - pulse.at(t_us)).norm();
                assert!(error < 2e-3, "{name} {t_us}: {error}");
            }
        }
    }

    /// Departure and arrival are two convolutions with Kuc and Siegel's impulse response.
    #[test]
    fn disc_matches_kuc_siegel() {
        let sensor = preset("senscomp-6500");
        let Aperture::Piston { radius_m, .. } = sensor.aperture else { panic!("a disc") };
        let pulse = EchoShape::for_sensor(&sensor);
        let (leaving, arriving) = (0.15_f64, -0.3_f64);
        let omega = TAU * sensor.frequency_hz;
        let steps = 160;
        // Midpoint rule; equal-area nodes would converge faster.
        let delays = |theta: f64| {
            let span_s = radius_m * theta.sin().abs() / SPEED_M_S;
            let step_s = 2.0 * span_s / f64::from(steps);
            (0..steps)
                .map(|i| (f64::from(i) + 0.5) * step_s - span_s)
                .map(|t| (t, step_s * kuc_siegel_response(t, radius_m, theta, SPEED_M_S)))
                .collect::<Vec<_>>()
        };
        let response = ApertureResponse::new(&sensor, SPEED_M_S).expect("a face");
        let echo = response.echo(&far(leaving, arriving)).expect("an echo");
        for i in (-120..440).step_by(20) {
            let t_us = f64::from(i);
            let mut sum = Complex64::ZERO;
            for (first, weight) in delays(leaving) {
                for (second, second_weight) in delays(arriving) {
                    let turn = Complex64::cis(-omega * (first + second));
                    sum += weight * second_weight * turn * pulse.at(t_us - 1e6 * (first + second));
                }
            }
            assert!((echo.at(t_us) - sum).norm() < 5e-4, "{t_us}: {} {sum}", echo.at(t_us));
        }
    }

    /// Two equal discs face to face (a disc and its mirror image), at one frequency: Rogers and Van
    /// Buren, "An exact expression for the Lommel diffraction correction integral", JASA 55 (1974),
    /// `1 - exp(-i x) (J0(x) + i J1(x))` with `x = k a^2 / z`.
    #[test]
    fn near_mirror_matches_lommel() {
        let sensor = preset("senscomp-6500");
        let Aperture::Piston { radius_m, .. } = sensor.aperture else { panic!("a disc") };
        let response = ApertureResponse::new(&sensor, SPEED_M_S).expect("a face");
        let k = TAU * sensor.frequency_hz / SPEED_M_S;
        // Bessel's integral, exact to rounding on a periodic grid.
        let bessel = |n: f64, x: f64| {
            let at = |i: u32| PI * (f64::from(i) + 0.5) / 200.0;
            (0..200).map(|i| (n * at(i) - x * at(i).sin()).cos()).sum::<f64>() / 200.0
        };
        for length_m in [0.188, 0.3, 0.6, 1.2, 4.0] {
            let head_on =
                Incidence { leaving_rad: 0.0, arriving_rad: 0.0, length_m, image: Image::Swapped };
            let leads = response.leads_m(&head_on);
            let face: Complex64 =
                leads.iter().map(|(m, share)| share * Complex64::cis(k * m)).sum();
            let x = k * radius_m * radius_m / length_m;
            let bessels = Complex64::new(bessel(0.0, x), bessel(1.0, x));
            let lommel = Complex64::ONE - Complex64::cis(-x) * bessels;
            // Lommel's result is relative to a plane wave, this one to a point source, which is `x
            // / 2` of that.
            let error = face.norm() - 2.0 * lommel.norm() / x;
            assert!(error.abs() < 1e-5, "{length_m}: {error}");
        }
    }

    /// Reference `head_on`: peak and bias of a head-on wall versus range, relative to 1 m.
    #[test]
    fn head_on_walls_match_full_wave() {
        let response = ApertureResponse::new(&preset("fullwave-line"), SPEED_M_S).expect("a face");
        let wall = |range_m: f64| {
            let length_m = 2.0 * range_m;
            let head_on =
                Incidence { leaving_rad: 0.0, arriving_rad: 0.0, length_m, image: Image::Swapped };
            response.echo(&head_on).expect("an echo")
        };
        // Range, level in the middle of the burst, bias at a threshold of 0.02.
        let reference = [
            (0.15, 0.97377, -7.685),
            (0.3, 1.00187, -7.885),
            (0.6, 0.99804, -7.965),
            (2.0, 0.98788, -8.017),
        ];
        for (range_m, height, bias_mm) in reference {
            let compensation = (1.0 + 162.0 * SPEED_M_S * 1e-6 / (2.0 * range_m)).sqrt();
            let found = wall(range_m).at(162.0).norm() * compensation;
            assert!((found / height - 1.0).abs() < 2e-3, "{range_m}: {found} for {height}");
            let rise_us = wall(range_m).rise_us(0.02).expect("it gets there");
            let found_mm = rise_us * SPEED_M_S * 1e-3 / 2.0;
            // The reference's band ends 20 kHz off the carrier.
            assert!((found_mm - bias_mm).abs() < 0.1, "{range_m}: {found_mm} for {bias_mm}");
        }
    }
}
