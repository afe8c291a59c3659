//! Simulated sweeps from random positions.

use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;
use sonard_inverse::{FiringOutcome, SweepFiring, World};
use sonard_model::{
    acoustics::{EchoRise, TofNoise},
    geometry::{DVec2, Pose},
    reading::PingStatus,
    scene::Scene,
};

/// Number of beams in a sweep.
pub(crate) const BEAMS: u32 = 400;
/// Standard deviation of ranges, millimetres.
pub(crate) const NOISE_MM: f64 = 1.0;

/// Sweep with range noise, its far tail, and a threshold that varies between firings with a
/// standard deviation in decibels.
pub(crate) fn readings(
    truth: &World,
    pose: &Pose,
    sigma_db: f64,
    rng: &mut Pcg64,
) -> Option<Vec<SweepFiring>> {
    let simulator = truth.simulator(pose).ok()?;
    let (point, speed_m_s) = (simulator.at(pose.position()), simulator.sound_speed_m_s());
    let noise = TofNoise::from_range_sigma_mm(NOISE_MM, speed_m_s);
    let beam = |at: u32| {
        let azimuth_deg = 360.0 * f64::from(at) / f64::from(BEAMS);
        let direction_rad = truth.direction_rad(pose, azimuth_deg);
        let factor = if sigma_db > 0.0 { threshold_factor(sigma_db, rng) } else { 1.0 };
        let rise = point.evaluate(direction_rad, |firing| {
            firing.evaluate_thresholds(simulator.receiver(), |listening| {
                listening.first_rise(factor, 0.0)
            })
        });
        let late_us = noise.sample_us(rng);
        let outcome = match rise.ok()? {
            Some(EchoRise { status: PingStatus::Echo, range_m, .. }) => {
                FiringOutcome::Echo { tof_us: 2e6 * range_m / speed_m_s + late_us }
            }
            None => FiringOutcome::NoEcho,
            Some(EchoRise { status: PingStatus::MinRange, .. }) => FiringOutcome::BelowMinRange,
            Some(_) => return None,
        };
        Some(SweepFiring { azimuth_deg, outcome })
    };
    Some((0..BEAMS).filter_map(beam).collect())
}

fn threshold_factor(sigma_db: f64, rng: &mut Pcg64) -> f64 {
    let normal: f64 = StandardNormal.sample(rng);
    10f64.powf(sigma_db * normal / 20.0)
}

/// Random position with clearance within the extent of the walls.
pub(crate) fn place(scene: &Scene, rng: &mut Pcg64) -> Option<Pose> {
    let ends = || scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let low = ends().fold(DVec2::INFINITY, DVec2::min);
    let high = ends().fold(DVec2::NEG_INFINITY, DVec2::max);
    (0..1000).find_map(|_| {
        let share = DVec2::new(rng.random(), rng.random());
        let [x_m, y_m] = (low + share * (high - low).max(DVec2::splat(0.5))).to_array();
        let pose = Pose { x_m, y_m, heading_deg: rng.random_range(-180.0..180.0) };
        let has_room = scene.clearance_m(pose.position()) > 0.3;
        (has_room && scene.check_pose(&pose).is_ok()).then_some(pose)
    })
}
