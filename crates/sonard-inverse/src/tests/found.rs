//! Parameters and poses that are found again from what they predict.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use sonard_model::{
    acoustics::TofNoise,
    geometry::{Pose, wrap_180},
    reading::PingStatus,
};
use uuid::Uuid;

use super::{first_pose, world};
use crate::{Atlas, Beam, Fit, Heard, Parameter, Prior, Sweep, World, fit, locate};

/// A sweep as a world has it, with noise, said to be from another pose.
pub(super) fn sweep(
    world: &World,
    pose: &Pose,
    believed: &Pose,
    beams: u32,
    noise: TofNoise,
    seed: u64,
) -> Sweep {
    let mut rng = Pcg64::seed_from_u64(seed);
    let simulator = world.simulator(pose).expect("a model");
    let point = simulator.at(pose.position());
    let us_per_m = 2e6 / simulator.sound_speed_m_s();
    let beams = (0..beams).filter_map(|at| {
        let azimuth_deg = 360.0 * f64::from(at) / f64::from(beams);
        let read = point.ping(world.direction_rad(pose, azimuth_deg)).expect("paths");
        let late_us = noise.sample_us(&mut rng);
        let tof_us = |range_m: f64| (range_m + world.delay_m) * us_per_m + late_us;
        let heard = match (read.status, read.range_m) {
            (PingStatus::Echo, Some(range_m)) => Heard::Echo { tof_us: tof_us(range_m) },
            (PingStatus::NoEcho, _) => Heard::Silence,
            _ => return None,
        };
        Some(Beam { azimuth_deg, heard })
    });
    Sweep { scan: Uuid::nil(), pose: *believed, beams: beams.collect() }
}

#[test]
fn pose_air_and_threshold_come_back() {
    let here = world("simple-room", "senscomp-6500");
    let pose = first_pose(&here.scene);
    let truth = here
        .changed(&[(&Parameter::SoundSpeed, 0.008), (&Parameter::Threshold, 4.0)])
        .expect("a world");
    let believed =
        Pose { x_m: pose.x_m + 0.05, y_m: pose.y_m - 0.06, heading_deg: pose.heading_deg + 5.0 };
    let noise = TofNoise::of_range_mm(1.0, truth.air.sound_speed_m_s());
    let sweep = sweep(&truth, &pose, &believed, 400, noise, 1);
    let of = |parameter, sigma| Prior { parameter, sigma };
    let what = Fit {
        priors: vec![
            of(Parameter::X(0), 0.1),
            of(Parameter::Y(0), 0.1),
            of(Parameter::Heading(0), 8.0),
            of(Parameter::SoundSpeed, 0.015),
            of(Parameter::Threshold, 6.0),
        ],
        widest_m: 0.1,
        widest_turn_deg: 12.0,
        least_sigma_m: 2e-4,
        least_sigma_db: 0.5,
    };
    let fitted = fit(&here, &[sweep], &what).expect("a fit");
    let expected = [-0.05, 0.06, -5.0, 0.008, 4.0];
    for (estimate, expected) in fitted.estimates.iter().zip(expected) {
        let off = (estimate.change - expected).abs();
        assert!(off < 4.0 * estimate.sigma && estimate.identified, "{estimate:?} for {expected}");
    }
    assert!(fitted.estimates[0].sigma < 1e-3 && fitted.estimates[2].sigma < 0.3);
}

/// Held to a threshold that is 9 dB too high, a fit would have it fall with the range, which no receiver's does: it
/// stops where there is no rise, with an interval that begins there, and says so.
#[test]
fn what_would_go_past_its_limit_is_held_there_and_told() {
    let mut here = world("simple-room", "senscomp-6500");
    let pose = first_pose(&here.scene);
    let sweeps = [sweep(&here, &pose, &pose, 400, TofNoise::NONE, 1)];
    here.sensor.threshold *= 10f64.powf(9.0 / 20.0);
    here.sensor.threshold_rise_db_per_m = 0.5;
    let of = |parameter, sigma| Prior { parameter, sigma };
    let what = Fit {
        priors: vec![of(Parameter::ThresholdRise, 5.0), of(Parameter::Threshold, 0.01)],
        widest_m: 0.02,
        widest_turn_deg: 0.0,
        least_sigma_m: 2e-4,
        least_sigma_db: 0.5,
    };
    let fitted = fit(&here, &sweeps, &what).expect("a fit");
    assert_eq!(fitted.world.sensor.threshold_rise_db_per_m, 0.0);
    let told = &fitted.told(&here, &sweeps, &what)[0];
    assert!(told.at_limit && told.value == 0.0 && told.low == 0.0, "{told:?}");
    assert!(told.sigma > 0.0 && told.high > 0.0 && told.remark() == "at its limit", "{told:?}");
}

/// A ranger that tells whole centimetres is not believed to the millimetre where several readings happen to be alike.
#[test]
fn steps_of_the_range_are_part_of_its_spread() {
    const STEP_M: f64 = 0.01;
    let mut here = world("simple-room", "hc-sr04");
    here.sensor.range_step_m = STEP_M;
    let pose = first_pose(&here.scene);
    let believed =
        Pose { x_m: pose.x_m + 0.03, y_m: pose.y_m - 0.02, heading_deg: pose.heading_deg };
    let sweep = sweep(&here, &pose, &believed, 120, TofNoise::NONE, 1);
    let of = |parameter, sigma| Prior { parameter, sigma };
    let what = Fit {
        priors: vec![
            of(Parameter::X(0), 0.1),
            of(Parameter::Y(0), 0.1),
            of(Parameter::Heading(0), 8.0),
        ],
        widest_m: 0.1,
        widest_turn_deg: 12.0,
        least_sigma_m: 2e-4,
        least_sigma_db: 0.5,
    };
    let fitted = fit(&here, &[sweep], &what).expect("a fit");
    let spread_m = STEP_M / 12f64.sqrt();
    assert!((spread_m..1.6 * spread_m).contains(&fitted.errors.sigma_m), "{:?}", fitted.errors);
    for (estimate, expected) in fitted.estimates.iter().zip([-0.03, 0.02]) {
        let off_m = (estimate.change - expected).abs();
        assert!(off_m < 3.0 * estimate.sigma && estimate.sigma < 2e-3, "{estimate:?}");
    }
}

#[test]
fn a_sweep_is_found_without_a_guess() {
    let here = world("simple-room", "senscomp-6500");
    let atlas = Atlas::new(&here, 0.1).expect("an atlas");
    let mut rng = Pcg64::seed_from_u64(3);
    let noise = TofNoise::of_range_mm(1.0, here.air.sound_speed_m_s());
    for trial in 0..6 {
        let pose = loop {
            let heading_deg = rng.random_range(-180.0..180.0);
            let pose = Pose {
                x_m: rng.random_range(-3.0..5.0),
                y_m: rng.random_range(-3.0..5.0),
                heading_deg,
            };
            if here.scene.check_pose(&pose).is_ok()
                && here.scene.clearance_m(pose.position()) > 0.15
            {
                break pose;
            }
        };
        let swept =
            sweep(&here, &pose, &Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 }, 400, noise, trial);
        let modes = locate(&here, &atlas, &swept).expect("modes");
        let is_right = modes.iter().any(|mode| {
            let off_m = (mode.x_m - pose.x_m).hypot(mode.y_m - pose.y_m);
            off_m < 0.02 && wrap_180(mode.heading_deg - pose.heading_deg).abs() < 1.0
        });
        assert!(is_right, "{pose:?}: {modes:?}");
    }
}
