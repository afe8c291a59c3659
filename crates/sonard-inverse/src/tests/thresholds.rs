//! Ranges with a threshold that varies from firing to firing, for a single wall ahead.

use nalgebra::DVector;
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;
use sonard_model::{
    acoustics::{EchoRise, TofNoise},
    geometry::Pose,
};

use super::{SIGMA_DB, as_read, before_a_wall};
use crate::{
    ErrorModel, FiringOutcome, FitSweep, Hypotheses, Parameter, SweepFiring, World,
    candidates::Phases, jacobian::JacobianBuilder,
};

const AT: Pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };

fn sweep(
    azimuths_deg: impl Iterator<Item = f64>,
    outcome: impl Fn(f64) -> FiringOutcome,
) -> FitSweep {
    let beam = |azimuth_deg| SweepFiring { azimuth_deg, outcome: outcome(azimuth_deg) };
    let beams = azimuths_deg.map(beam);
    FitSweep { scan: uuid::Uuid::nil(), pose: AT, beams: beams.collect() }
}

/// Readings at a step in degrees, with noise, for a varying threshold.
fn read(here: &World, every_deg: f64, rng: &mut Pcg64) -> FitSweep {
    let normal = Normal::new(0.0, SIGMA_DB).expect("a distribution");
    let noise = TofNoise::from_range_sigma_mm(1.0, here.air.sound_speed_m_s());
    let us_per_m = 2e6 / here.air.sound_speed_m_s();
    let to = (20.0 / every_deg) as i32;
    let mut read = sweep((-to..to).map(|at| every_deg * f64::from(at)), |_| FiringOutcome::NoEcho);
    for beam in &mut read.beams {
        let rise = rises(here, beam.azimuth_deg, &[normal.sample(rng)])[0];
        if let Some(rise) = rise {
            let tof_us = us_per_m * rise.range_m + noise.sample_us(rng);
            beam.outcome = FiringOutcome::Echo { tof_us };
        }
    }
    read
}

/// Detections in a direction at thresholds relative to the nominal one, decibels.
fn rises(here: &World, azimuth_deg: f64, by_db: &[f64]) -> Vec<Option<EchoRise>> {
    let simulator = here.simulator(&AT).expect("a model");
    let direction_rad = here.direction_rad(&AT, azimuth_deg);
    let detected = simulator.at(AT.position()).evaluate(direction_rad, |firing| {
        let rise = |by_db: &f64| {
            let factor = 10f64.powf(by_db / 20.0);
            firing.evaluate_thresholds(simulator.receiver(), |listening| {
                listening.first_rise(factor, 0.0)
            })
        };
        by_db.iter().map(rise).collect()
    });
    detected.expect("paths")
}

/// Mean and scatter of many firings' ranges, from far above the threshold to a detection in one of
/// twenty.
#[test]
fn expected_ranges_match_simulation() {
    let here = before_a_wall(1.2, 3.0);
    let mut rng = Pcg64::seed_from_u64(1);
    let normal = Normal::new(0.0, SIGMA_DB).expect("a distribution");
    let by_db: Vec<f64> = (0..4000).map(|_| normal.sample(&mut rng)).collect();
    let azimuths_deg = || (0..400).map(|at| 0.05 * f64::from(at));
    let builder = JacobianBuilder::new(&here, &[], here.air.sound_speed_m_s(), Phases::Known);
    let simulator = here.simulator(&AT).expect("a model");
    let azimuths = sweep(azimuths_deg(), |_| FiringOutcome::NoEcho);
    let point = simulator.at(AT.position());
    let readings = builder.sweep(&simulator, &point, 0, &azimuths, &AT).expect("candidates");
    let walk = builder.time_walk(simulator.receiver());
    let errors = ErrorModel::rough(1e-3, SIGMA_DB, 3.0);
    let (mut weak, mut late_m) = (0, 0.0_f64);
    for (azimuth_deg, beam) in azimuths_deg().zip(&readings) {
        let first = &beam.possible[0];
        if first.outcome.range_m().is_none() || first.until_db < -0.8 {
            continue;
        }
        let limits_db = [f64::NEG_INFINITY, first.until_db];
        let still = DVector::zeros(0);
        let expected = first.expected(&still, limits_db, &errors, &walk).expect("an echo");
        let detected: Vec<f64> = rises(&here, azimuth_deg, &by_db)
            .iter()
            .filter_map(|rise| rise.map(|rise| rise.range_m))
            .collect();
        let count = detected.len() as f64;
        let mean_m = detected.iter().sum::<f64>() / count;
        let squares: f64 = detected.iter().map(|range_m| (range_m - mean_m).powi(2)).sum();
        let spread_m = (squares / count).sqrt();
        let off_m = expected.range_m - mean_m;
        let expected_m = (expected.sigma_m.powi(2) - errors.sigma_m.powi(2)).sqrt();
        let of = format!("at {azimuth_deg}, until {:.2} dB", first.until_db);
        // Four standard errors and a fraction of the scatter: the effective threshold drifts during
        // a rise.
        assert!(
            off_m.abs() < 4.0 * spread_m / count.sqrt() + 0.2 * spread_m + 1e-6,
            "{of}: {off_m} {spread_m}"
        );
        let ratio = expected_m / spread_m;
        assert!((0.75..1.3).contains(&ratio), "{of}: {expected_m} for {spread_m}");
        weak += u32::from(first.until_db < 1.0);
        late_m = late_m.max(expected.range_m - 1.2);
    }
    assert!(weak >= 5 && late_m > 0.01, "{weak} {late_m}");
}

/// The gradient by the threshold, including time walk, equals the finite difference.
#[test]
fn threshold_gradient_matches_differences() {
    let here = before_a_wall(1.2, 3.0);
    let read = read(&here, 0.1, &mut Pcg64::seed_from_u64(2));
    let errors = as_read(3.0);
    let at = |by_db: f64| {
        let world = here.changed(&[(&Parameter::Threshold, by_db)]).expect("a world");
        let hypotheses = Hypotheses::new(world, vec![Parameter::Threshold]).expect("a model");
        hypotheses.log_likelihood(&read, &AT, &errors).expect("paths")
    };
    let root = at(0.0).information[(0, 0)].sqrt();
    for step in -4..=4 {
        let (by_db, aside_db) = (0.25 * f64::from(step), 0.05);
        let [before, here, after] = [by_db - aside_db, by_db, by_db + aside_db].map(at);
        let expected = (after.value - before.value) / (2.0 * aside_db);
        let gradient = here.gradient[0];
        // The change of its weight and scatter is omitted.
        assert!(
            (gradient - expected).abs() < 0.5 * root + 0.2 * expected.abs(),
            "{by_db}: {gradient} for {expected}, {root}"
        );
    }
    // The maximum is at the truth.
    let likeliest = at(0.0);
    assert!((likeliest.gradient[0] / root).abs() < 3.0, "{likeliest:?}");
}

/// Information on a heading, averaged over many sweeps: variance of the score, Fisher information,
/// and curvature of the likelihood agree. Where a wall's echo is lost the level falls by ten
/// decibels per degree, two to three times as steeply as the flank of a main lobe.
#[test]
fn heading_information_is_consistent() {
    const SWEEPS: u32 = 60;
    const BY_DEG: f64 = 0.02;
    let (here, errors) = (before_a_wall(1.2, 3.0), as_read(3.0));
    let mut rng = Pcg64::seed_from_u64(3);
    let hypotheses = Hypotheses::new(here.clone(), vec![Parameter::Heading(0)]).expect("a model");
    let [mut information, mut varies, mut falls] = [0.0; 3];
    for _ in 0..SWEEPS {
        let read = read(&here, 0.2, &mut rng);
        let [before, at, after] = [-BY_DEG, 0.0, BY_DEG].map(|by_deg| {
            let pose = Pose { heading_deg: by_deg, ..AT };
            hypotheses.log_likelihood(&read, &pose, &errors).expect("paths")
        });
        information += at.information[(0, 0)];
        varies += at.gradient[0].powi(2);
        falls += (2.0 * at.value - before.value - after.value) / (BY_DEG * BY_DEG);
    }
    for (name, found) in [("varies", varies), ("falls", falls)] {
        let share = found / information;
        assert!((0.7..1.4).contains(&share), "{name}: {share} of {information}");
    }
}
