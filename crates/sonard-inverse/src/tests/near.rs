//! Readings of a wall so near that its echo sounds already when the receiver begins to listen.

use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;
use sonard_model::{acoustics::Rise, geometry::Pose, reading::PingStatus};

use super::{SIGMA_DB, as_read, before_a_wall};
use crate::{Beam, Heard, Hypotheses, Parameter, Sweep, World};

/// Just nearer than the least range of 0.41 m: straight on the echo is there already, aside it rises later.
const WALL_M: f64 = 0.408;

fn at(x_m: f64) -> Pose {
    Pose { x_m, y_m: 0.0, heading_deg: 0.0 }
}

/// Readings from the middle by thresholds that vary.
fn read(here: &World, rng: &mut Pcg64) -> Sweep {
    let normal = Normal::new(0.0, SIGMA_DB).expect("a distribution");
    let simulator = here.simulator(&at(0.0)).expect("a model");
    let point = simulator.at(at(0.0).position());
    let mut heard = |azimuth_deg: f64| {
        let factor = 10f64.powf(normal.sample(rng) / 20.0);
        let rise = point.hear(here.direction_rad(&at(0.0), azimuth_deg), |firing| {
            firing.listen(simulator.receiver(), |listening| listening.rise(factor, 0.0))
        });
        match rise.expect("paths") {
            Some(Rise { status: PingStatus::MinRange, .. }) => Heard::Near,
            Some(Rise { range_m, .. }) => {
                Heard::Echo { tof_us: 2e6 * range_m / simulator.sound_speed_m_s() }
            }
            None => Heard::Silence,
        }
    };
    let azimuths_deg = (-60..60).map(|at| 0.25 * f64::from(at));
    let beams =
        azimuths_deg.map(|azimuth_deg| Beam { azimuth_deg, heard: heard(azimuth_deg) }).collect();
    Sweep { scan: uuid::Uuid::nil(), pose: at(0.0), beams }
}

/// Which of the beams of an arc's ends are too near is decided by the threshold, too: it is right on average only with them.
#[test]
fn thresholds_are_right_on_average_beside_what_is_too_near() {
    const SWEEPS: u32 = 200;
    let (here, errors) = (before_a_wall(WALL_M, 2.0), as_read(2.0));
    let asked = Hypotheses::new(here.clone(), vec![Parameter::Threshold]).expect("a model");
    let mut rng = Pcg64::seed_from_u64(5);
    let (mut sum, mut squares, mut without) = (0.0, 0.0, 0.0);
    let mut mixed = 0;
    for _ in 0..SWEEPS {
        let sweep = read(&here, &mut rng);
        let score = |sweep: &Sweep| {
            asked.log_likelihood(sweep, &at(0.0), &errors).expect("paths").gradient[0]
        };
        let score_of_all = score(&sweep);
        sum += score_of_all;
        squares += score_of_all * score_of_all;
        let (near, others): (Vec<Beam>, Vec<Beam>) =
            sweep.beams.iter().partition(|beam| beam.heard == Heard::Near);
        mixed += near.len();
        without += score(&Sweep { beams: others, ..sweep.clone() });
    }
    assert!(mixed > 1000, "{mixed} beams too near");
    let [mean, beside] = [sum, without].map(|of| of / f64::from(SWEEPS));
    let error = squares.sqrt() / f64::from(SWEEPS);
    assert!(mean.abs() < 4.0 * error, "{mean} +- {error}");
    // Left out, they would make it seem higher than it is.
    assert!(beside > 5.0 * error, "{beside} +- {error}");
}

/// And they say that there is something, and nothing farther off.
#[test]
fn what_is_too_near_is_of_a_near_wall() {
    let (here, errors) = (before_a_wall(WALL_M, 2.0), as_read(2.0));
    let mut read = read(&here, &mut Pcg64::seed_from_u64(6));
    read.beams.retain(|beam| beam.heard == Heard::Near);
    let asked = Hypotheses::new(here, vec![Parameter::X(0)]).expect("a model");
    let likely = |x_m: f64| asked.log_likelihood(&read, &at(x_m), &errors).expect("paths").value;
    let count = read.beams.len() as f64;
    assert!(likely(0.0) > -0.3 * count, "{} of {count}", likely(0.0));
    for farther_m in [0.01, 0.03, 0.1] {
        assert!(likely(-farther_m) < -2.0 * count, "{farther_m}: {}", likely(-farther_m));
    }
}
