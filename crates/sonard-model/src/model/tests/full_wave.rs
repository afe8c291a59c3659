//! Comparison with the full-wave scans (tests/data/fullwave/README.md, and those of whole bodies by
//! tests/peers/full_wave.py): the receiver's first crossing on the sum of all echoes, and the
//! height of the envelope peak that crosses.
//!
//! The figures, reflected and diffracted echoes separately:
//! `cargo test --lib tests::full_wave -- --nocapture`

use super::{
    reference::{Crossing, Reference, ReferenceScene},
    *,
};
use crate::{acoustics::Sensor, model::Prediction, reading::PingStatus};

impl Crossing {
    /// Returns `true` if an echo grazes the threshold here.
    fn is_fragile(&self) -> bool {
        let (Some(low), Some(high)) = (self.range_unbiased_09tau, self.range_unbiased_11tau) else {
            return true;
        };
        (high - low).abs() > FRAGILE_M
    }
}

/// Ranges at thresholds 10 % lower and higher differ by more than this where an echo grazes the
/// threshold; on a steep slope they differ by half a millimetre.
const FRAGILE_M: f64 = 3e-3;

fn simulator_of(of: &ReferenceScene, c: f64, options: Options) -> Simulator {
    let walls = of
        .segments
        .iter()
        .enumerate()
        .map(|(i, s)| wall(&format!("w{i}"), (s[0], s[1]), (s[2], s[3]), 1.0))
        .collect();
    let air = Air::default().with_sound_speed(c).expect("a speed");
    let sensor = Sensor::preset("fullwave-line").expect("a preset");
    Simulator::new(Arc::new(scene(walls)), sensor, air, options).expect("good options")
}

/// Errors of one kind of echo.
#[derive(Default)]
struct Errors {
    range_mm: Vec<f64>,
    amplitude_db: Vec<f64>,
}

impl Errors {
    fn quantile(values: &[f64], part: f64) -> f64 {
        let mut sizes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        sizes
            .get((sizes.len().saturating_sub(1) as f64 * part).round() as usize)
            .copied()
            .unwrap_or(0.0)
    }

    fn report(&self, what: &str) {
        println!(
            "{what}: {} ranges off by {:.2} mm (median), {:.2} mm (95 %), {:.2} mm (most); \
             {} amplitudes by {:.2} dB, {:.2} dB, {:.2} dB",
            self.range_mm.len(),
            Self::quantile(&self.range_mm, 0.5),
            Self::quantile(&self.range_mm, 0.95),
            Self::quantile(&self.range_mm, 1.0),
            self.amplitude_db.len(),
            Self::quantile(&self.amplitude_db, 0.5),
            Self::quantile(&self.amplitude_db, 0.95),
            Self::quantile(&self.amplitude_db, 1.0),
        );
    }
}

/// Scores of all scenes.
#[derive(Default)]
struct Score {
    /// Reflected and diffracted.
    errors: [Errors; 2],
    fragile: usize,
    /// Beams where only one of both has an echo.
    disagree: usize,
}

impl Score {
    fn beam(&mut self, what: &str, crossing: Option<&Crossing>, found: &Prediction) {
        match (crossing, found.status) {
            (Some(crossing), _) if crossing.is_fragile() => self.fragile += 1,
            (Some(crossing), PingStatus::Echo) => {
                let range_m = found.range_m.expect("a range");
                let errors = &mut self.errors[kind(found)];
                errors.range_mm.push(1e3 * (range_m - crossing.range_unbiased));
            }
            // A decibel above the threshold may be below it there.
            (None, PingStatus::Echo) if found.margin_db.expect("a margin") > 1.0 => {
                self.disagree += 1;
                println!("{what}: echo by {:?} dB, not in the reference", found.margin_db);
            }
            (Some(_), _) => {
                self.disagree += 1;
                println!("{what}: no echo by {:?} dB, unlike the reference", found.margin_db);
            }
            (None, _) => {}
        }
    }

    /// Compares the envelope peak that crosses with the reference's; not where it has several
    /// maxima, of which `found` names the highest.
    fn height(&mut self, peaks: &[(f64, f64)], c: f64, found: &Prediction) {
        let Some(range_m) = found.range_m else { return };
        let since_s = |time_s: f64| time_s - 2.0 * range_m / c;
        let is_near = |peak: &&(f64, f64)| (-50e-6..420e-6).contains(&since_s(peak.0));
        let near: Vec<_> = peaks.iter().filter(is_near).collect();
        if let [peak] = near[..]
            && since_s(peak.0) >= 0.0
        {
            let amplitude = found.amplitude.expect("an amplitude");
            self.errors[kind(found)].amplitude_db.push(20.0 * (amplitude / peak.1).log10());
        }
    }
}

/// 0 for a reflected echo, 1 for a diffracted one.
fn kind(found: &Prediction) -> usize {
    let arrival = found.arrival.as_ref().expect("an echo");
    usize::from(arrival.path.kind() == PathKind::Diffracted)
}

#[test]
fn ranges_match_full_wave() {
    // The reference's own error bars are 0.5 mm, and 0.5 dB for the ends of plates.
    ranges_agree(&Reference::given(), false, 0.5);
}

/// Around whole bodies and in notches sound is also diffracted twice.
#[test]
fn ranges_match_boundary_integrals() {
    ranges_agree(&Reference::bodies(), true, 1.0);
}

fn ranges_agree(reference: &Reference, double_diffraction: bool, most_db: f64) {
    let mut score = Score::default();
    for (name, of) in &reference.scenes {
        for tau in ["0.02", "0.05", "0.1"] {
            let threshold = Some(tau.parse().expect("a number"));
            let lossless =
                PathOptions { lossless: true, double_diffraction, ..PathOptions::default() };
            let lossless = Options { threshold, ..lossless.into() };
            let simulator = simulator_of(of, reference.c, lossless);
            let point = simulator.at(DVec2::from_array(of.sensor));
            for beam in &of.scan {
                let found = point.ping(beam.azimuth.to_radians()).expect("few paths");
                let what = format!("{name}, {} degrees, threshold {tau}", beam.azimuth);
                score.beam(&what, beam.threshold[tau].as_ref(), &found);
                if tau == "0.02" {
                    score.height(&beam.peaks, reference.c, &found);
                }
            }
        }
    }
    println!("{} fragile azimuths not scored", score.fragile);
    let [mirrored, bent] = &score.errors;
    mirrored.report("mirrored");
    bent.report("bent");
    assert_eq!(score.disagree, 0);
    assert!(mirrored.range_mm.len() > 50 && bent.range_mm.len() > 20);
    for errors in [mirrored, bent] {
        assert!(Errors::quantile(&errors.range_mm, 1.0) < 1.0);
        assert!(Errors::quantile(&errors.amplitude_db, 1.0) < most_db);
    }
}
