//! Comparison with full-wave scans (tests/data/fullwave/README.md): their short-pulse arrivals.
//!
//! The echo paths are combined with the reference's own line aperture and short pulse, at each
//! frequency of its band, so only the paths and their amplitudes are compared.

use num_complex::Complex64;

use super::*;
use crate::{
    acoustics::edge::EdgeView,
    model::{
        paths::{diffraction::single, echo::PathEcho},
        tests::reference::{Reference, ReferenceScene},
    },
};

/// Standard deviation of the band, and its significant half width, hertz.
const BAND_SIGMA_HZ: f64 = 7000.0;
const BAND_HZ: f64 = 20_000.0;

/// Grids of frequency and of path length.
const STEP_HZ: f64 = 1000.0;
const STEP_M: f64 = 0.0007;

/// Points of the aperture.
const POINTS: i32 = 16;

/// Paths from a place at each of the band's frequencies.
struct Chain {
    c: f64,
    f0: f64,
    half_width_m: f64,
    /// Echoes by frequency, always the same ones.
    echoes: Vec<(f64, Vec<EchoPulse>)>,
}

/// An echo, and the aspect of its edge from the face.
struct EchoPulse {
    echo: EchoPath,
    edge: Option<EdgeView>,
}

impl Chain {
    fn new(reference: &Reference, scene_of: &ReferenceScene, double_diffraction: bool) -> Self {
        let plan = scene(&scene_of.segments);
        let at = DVec2::from_array(scene_of.sensor);
        let steps = (2.0 * BAND_HZ / STEP_HZ) as i32;
        let echoes = (0..=steps)
            .map(|i| {
                let f = reference.f0 - BAND_HZ + STEP_HZ * f64::from(i);
                let settings = PathSettings {
                    max_path_m: 4.1,
                    floor: 1e-5,
                    edge_law: Some(EdgeLaw::Utd),
                    double_diffraction,
                    wave_number_per_m: TAU * f / reference.c,
                    ..LOSSLESS
                };
                let paths = Paths::new(&plan, settings);
                let (traced, echoes) = paths.trace(at, at, None).expect("few paths");
                let pulse = |echo: &PathEcho| EchoPulse {
                    echo: paths.path(&traced, echo),
                    edge: single::view(&paths.plan, &traced.out, traced.back(), echo),
                };
                (f, echoes.iter().map(pulse).collect())
            })
            .collect();
        let (c, f0) = (reference.c, reference.f0);
        Self { c, f0, half_width_m: reference.piston_half_width_m, echoes }
    }

    /// Two-way beam of the line aperture facing `azimuth_rad`: every point of it sends to every
    /// point of it. Far away that is `sin(x)/x` twice; at these ranges the front's curvature still
    /// fills the pattern's nulls (Fresnel's approximation).
    fn beam(&self, f: f64, EchoPulse { echo, edge }: &EchoPulse, azimuth_rad: f64) -> Complex64 {
        let (leaving, arriving) =
            (echo.departure_rad - azimuth_rad, echo.arrival_rad - azimuth_rad);
        let taper = taper(leaving) * taper(arriving);
        if taper == 0.0 {
            return Complex64::ZERO;
        }
        let k = TAU * f / self.c;
        // Seen through an odd number of mirrors the aperture is mirrored. An edge loses the place
        // of departure on the aperture, but has a different aspect from each place.
        let bent = echo.path.kind() == PathKind::Diffracted;
        let side = if reflectors(&echo.path).len() % 2 == 1 { -1.0 } else { 1.0 };
        let point = |i: i32| self.half_width_m * (f64::from(2 * i + 1) / f64::from(POINTS) - 1.0);
        let shares = edge.map(|edge| edge.relative_field());
        let mut sum = Complex64::ZERO;
        for u in (0..POINTS).map(point) {
            for v in (0..POINTS).map(point) {
                let (x, y) = (u * leaving.cos(), v * arriving.cos());
                let curved = if bent {
                    (x * x + y * y) / echo.length_m
                } else {
                    (x + side * y).powi(2) / (2.0 * echo.length_m)
                };
                let seen = shares.as_ref().map_or(Complex64::ONE, |share| share(x, y));
                sum += seen * Complex64::cis(k * (u * leaving.sin() + v * arriving.sin() - curved));
            }
        }
        sum * taper / f64::from(POINTS * POINTS)
    }

    /// Field of each echo at each frequency, weighted by the aperture facing `azimuth_rad`.
    fn spectrum(&self, azimuth_rad: f64) -> Vec<(f64, Vec<Complex64>)> {
        let weighed = |f: f64, pulse: &EchoPulse| {
            let EchoPulse { echo, .. } = pulse;
            Complex64::from_polar(echo.amplitude, echo.phase_rad) * self.beam(f, pulse, azimuth_rad)
        };
        let at = |(f, echoes): &(f64, Vec<EchoPulse>)| {
            (*f, echoes.iter().map(|pulse| weighed(*f, pulse)).collect())
        };
        self.echoes.iter().map(at).collect()
    }

    /// Maxima of the short pulse's envelope: length, amplitude, and `true` if an edge's share is
    /// the largest there.
    fn peaks(&self, azimuth_rad: f64) -> Vec<(f64, f64, bool)> {
        let spectrum = self.spectrum(azimuth_rad);
        let lengths: Vec<f64> = self.echoes[0].1.iter().map(|pulse| pulse.echo.length_m).collect();
        let middle = &spectrum[spectrum.len() / 2].1;
        let Some(first) = lengths.first() else { return Vec::new() };
        let count = ((lengths[lengths.len() - 1] - first + 0.1) / STEP_M) as usize;
        let place = |i: usize| first - 0.05 + STEP_M * i as f64;
        let near = |length: f64| lengths.iter().any(|other| (other - length).abs() < 0.05);
        let heights: Vec<f64> = (0..=count)
            .map(
                |i| if near(place(i)) { self.envelope(&spectrum, &lengths, place(i)) } else { 0.0 },
            )
            .collect();
        (1..count)
            .filter(|&i| heights[i] > heights[i - 1] && heights[i] >= heights[i + 1])
            .filter(|&i| heights[i] > 0.01 && is_prominent(&heights, i))
            .map(|i| {
                let strongest = (0..lengths.len())
                    .filter(|&e| (lengths[e] - place(i)).abs() < 0.015)
                    .max_by(|&a, &b| middle[a].norm().total_cmp(&middle[b].norm()));
                let bent = strongest
                    .is_some_and(|e| self.echoes[0].1[e].echo.path.kind() == PathKind::Diffracted);
                (place(i), heights[i], bent)
            })
            .collect()
    }

    fn envelope(&self, spectrum: &[(f64, Vec<Complex64>)], lengths: &[f64], at_m: f64) -> f64 {
        let mut sum = Complex64::ZERO;
        let mut whole = 0.0;
        for (f, fields) in spectrum {
            let weight = (-0.5 * ((f - self.f0) / BAND_SIGMA_HZ).powi(2)).exp();
            whole += weight;
            for (field, length) in fields.iter().zip(lengths) {
                if (length - at_m).abs() < 0.06 {
                    sum += weight * field * Complex64::cis(TAU * f / self.c * (at_m - length));
                }
            }
        }
        sum.norm() / whole
    }
}

/// No radiation to the rear: full within 75 degrees of the axis, none beyond 105.
fn taper(off_rad: f64) -> f64 {
    let off_deg = crate::geometry::wrap_pi(off_rad).abs().to_degrees();
    match off_deg {
        0.0..75.0 => 1.0,
        75.0..105.0 => 0.5 * (1.0 + (TAU / 2.0 * (off_deg - 75.0) / 30.0).cos()),
        _ => 0.0,
    }
}

/// The reference lists maxima whose prominence is more than 0.002 and 3 %.
fn is_prominent(heights: &[f64], i: usize) -> bool {
    let valley = |side: &mut dyn Iterator<Item = &f64>| {
        side.take_while(|&&h| h <= heights[i]).copied().fold(f64::INFINITY, f64::min)
    };
    let before = valley(&mut heights[..i].iter().rev());
    let after = valley(&mut heights[i + 1..].iter());
    heights[i] - before.max(after) > f64::max(0.002, 0.03 * heights[i])
}

#[derive(Default)]
struct Errors {
    amplitude_db: Vec<f64>,
    range_mm: Vec<f64>,
}

impl Errors {
    fn quantile(values: &mut [f64], part: f64) -> f64 {
        values.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        values.get(((values.len() - 1) as f64 * part).round() as usize).map_or(0.0, |v| v.abs())
    }

    fn report(&mut self, what: &str) -> [f64; 4] {
        let [a, r] = [&mut self.amplitude_db, &mut self.range_mm];
        let figures = [
            Self::quantile(a, 0.5),
            Self::quantile(a, 0.95),
            Self::quantile(r, 0.5),
            Self::quantile(r, 0.95),
        ];
        println!(
            "{what}: {} arrivals, amplitude off by {:.3} dB (median), {:.3} dB (95 %), range by \
             {:.2} mm, {:.2} mm",
            self.range_mm.len(),
            figures[0],
            figures[1],
            figures[2],
            figures[3]
        );
        figures
    }
}

fn compare(reference: &Reference, name: &str, double_diffraction: bool) -> [Errors; 2] {
    let scene_of = &reference.scenes[name];
    let chain = Chain::new(reference, scene_of, double_diffraction);
    let mut errors = [Errors::default(), Errors::default()];
    for beam in &scene_of.scan {
        let peaks = chain.peaks(beam.azimuth.to_radians());
        for &(time_s, amplitude) in &beam.arrivals {
            let length_m = time_s * reference.c;
            let found = peaks
                .iter()
                .filter(|peak| (peak.0 - length_m).abs() < 0.012)
                .min_by(|a, b| (a.0 - length_m).abs().total_cmp(&(b.0 - length_m).abs()));
            // Close to the level where the reference stops listing, one may list echoes that the
            // other does not.
            let Some(&(at, height, bent)) = found else {
                assert!(amplitude < 0.013, "{name}, {}: {amplitude} missing", beam.azimuth);
                continue;
            };
            let db = 20.0 * (height / amplitude).log10();
            if std::env::var_os("SONARD_VERBOSE").is_some() {
                println!(
                    "{name} {} {amplitude} {height:.4} {db:.2} {:.2} {bent}",
                    beam.azimuth,
                    500.0 * (at - length_m)
                );
            }
            errors[usize::from(bent)].amplitude_db.push(db);
            errors[usize::from(bent)].range_mm.push(500.0 * (at - length_m));
        }
        for (at, height, _) in &peaks {
            let known = beam.arrivals.iter().any(|a| (a.0 * reference.c - at).abs() < 0.012);
            assert!(known || *height < 0.013, "{name}, {}: {height} too much", beam.azimuth);
        }
    }
    errors
}

#[test]
fn arrivals_match_full_wave() {
    arrivals_agree(&Reference::given(), false);
}

/// Around whole bodies and in notches sound is also diffracted twice.
#[test]
fn arrivals_match_boundary_integrals() {
    arrivals_agree(&Reference::bodies(), true);
}

fn arrivals_agree(reference: &Reference, double_diffraction: bool) {
    let mut all = [Errors::default(), Errors::default()];
    for name in reference.scenes.keys() {
        let errors = compare(reference, name, double_diffraction);
        for (kind, mut errors) in errors.into_iter().enumerate() {
            if !errors.range_mm.is_empty() {
                errors.report(&format!("{name}, {}", ["mirrored", "bent"][kind]));
            }
            all[kind].amplitude_db.extend(errors.amplitude_db);
            all[kind].range_mm.extend(errors.range_mm);
        }
    }
    let [mirrored, bent] = &mut all;
    let [_, amplitude_db, _, range_mm] = mirrored.report("all mirrored");
    assert!(amplitude_db < 1.0 && range_mm < 2.0);
    let [_, amplitude_db, _, range_mm] = bent.report("all bent");
    assert!(amplitude_db < 1.5 && range_mm < 2.0);
}
