//! Readings of a wall below the minimum range.

use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;
use sonard_model::{acoustics::EchoRise, geometry::Pose, reading::PingStatus};

use super::{SIGMA_DB, as_read, before_a_wall};
use crate::{FiringOutcome, FitSweep, Hypotheses, Parameter, SweepFiring, World};

/// Just below the minimum range of 0.41 m: on the axis the echo falls into blanking, off it rises
/// later.
const WALL_M: f64 = 0.408;

fn at(x_m: f64) -> Pose {
    Pose { x_m, y_m: 0.0, heading_deg: 0.0 }
}

/// Readings from the origin with varying thresholds.
fn read(here: &World, rng: &mut Pcg64) -> FitSweep {
    let normal = Normal::new(0.0, SIGMA_DB).expect("a distribution");
    let simulator = here.simulator(&at(0.0)).expect("a model");
    let point = simulator.at(at(0.0).position());
    let mut outcome = |azimuth_deg: f64| {
        let factor = 10f64.powf(normal.sample(rng) / 20.0);
        let rise = point.evaluate(here.direction_rad(&at(0.0), azimuth_deg), |firing| {
            firing.evaluate_thresholds(simulator.receiver(), |listening| {
                listening.first_rise(factor, 0.0)
            })
        });
        match rise.expect("paths") {
            Some(EchoRise { status: PingStatus::MinRange, .. }) => FiringOutcome::BelowMinRange,
            Some(EchoRise { range_m, .. }) => {
                FiringOutcome::Echo { tof_us: 2e6 * range_m / simulator.sound_speed_m_s() }
            }
            None => FiringOutcome::NoEcho,
        }
    };
    let azimuths_deg = (-60..60).map(|at| 0.25 * f64::from(at));
    let beams = azimuths_deg
        .map(|azimuth_deg| SweepFiring { azimuth_deg, outcome: outcome(azimuth_deg) })
        .collect();
    FitSweep { scan: uuid::Uuid::nil(), pose: at(0.0), beams }
}

/// The threshold affects which beams at the ends of an arc are below the minimum range: its score
/// is unbiased only with them.
#[test]
fn threshold_score_is_unbiased() {
    const SWEEPS: u32 = 200;
    let (here, errors) = (before_a_wall(WALL_M, 2.0), as_read(2.0));
    let hypotheses = Hypotheses::new(here.clone(), vec![Parameter::Threshold]).expect("a model");
    let mut rng = Pcg64::seed_from_u64(5);
    let (mut sum, mut squares, mut without) = (0.0, 0.0, 0.0);
    let mut mixed = 0;
    for _ in 0..SWEEPS {
        let sweep = read(&here, &mut rng);
        let score = |sweep: &FitSweep| {
            hypotheses.log_likelihood(sweep, &at(0.0), &errors).expect("paths").gradient[0]
        };
        let score_of_all = score(&sweep);
        sum += score_of_all;
        squares += score_of_all * score_of_all;
        let (near, others): (Vec<SweepFiring>, Vec<SweepFiring>) =
            sweep.beams.iter().partition(|beam| beam.outcome == FiringOutcome::BelowMinRange);
        mixed += near.len();
        without += score(&FitSweep { beams: others, ..sweep.clone() });
    }
    assert!(mixed > 1000, "{mixed} beams below the minimum range");
    let [mean, biased] = [sum, without].map(|of| of / f64::from(SWEEPS));
    let error = squares.sqrt() / f64::from(SWEEPS);
    assert!(mean.abs() < 4.0 * error, "{mean} +- {error}");
    // Without them the threshold would seem higher.
    assert!(biased > 5.0 * error, "{biased} +- {error}");
}

/// They indicate that there is a target, and none farther off.
#[test]
fn minimum_range_constrains_the_wall() {
    let (here, errors) = (before_a_wall(WALL_M, 2.0), as_read(2.0));
    let mut read = read(&here, &mut Pcg64::seed_from_u64(6));
    read.beams.retain(|beam| beam.outcome == FiringOutcome::BelowMinRange);
    let hypotheses = Hypotheses::new(here, vec![Parameter::X(0)]).expect("a model");
    let likely =
        |x_m: f64| hypotheses.log_likelihood(&read, &at(x_m), &errors).expect("paths").value;
    let count = read.beams.len() as f64;
    assert!(likely(0.0) > -0.3 * count, "{} of {count}", likely(0.0));
    for farther_m in [0.01, 0.03, 0.1] {
        assert!(likely(-farther_m) < -2.0 * count, "{farther_m}: {}", likely(-farther_m));
    }
}
