//! Sweeps as a world has them, from random places.

use rand::RngExt as _;
use rand_pcg::Pcg64;
use sonard_inverse::{Beam, Heard, World};
use sonard_model::{
    acoustics::TofNoise,
    geometry::{DVec2, Pose},
    reading::PingStatus,
    scene::Scene,
};

/// Beams of a sweep.
pub(crate) const BEAMS: u32 = 400;
/// Spread of ranges, millimetres.
pub(crate) const NOISE_MM: f64 = 1.0;

/// A sweep with noise and its far tail.
pub(crate) fn readings(truth: &World, pose: &Pose, rng: &mut Pcg64) -> Option<Vec<Beam>> {
    let simulator = truth.simulator(pose).ok()?;
    let (point, speed_m_s) = (simulator.at(pose.position()), simulator.sound_speed_m_s());
    let noise = TofNoise::of_range_mm(NOISE_MM, speed_m_s);
    let beam = |at: u32| {
        let azimuth_deg = 360.0 * f64::from(at) / f64::from(BEAMS);
        let read = point.ping(truth.direction_rad(pose, azimuth_deg)).ok()?;
        let late_us = noise.sample_us(rng);
        let heard = match (read.status, read.range_m) {
            (PingStatus::Echo, Some(range_m)) => {
                Heard::Echo { tof_us: 2e6 * range_m / speed_m_s + late_us }
            }
            (PingStatus::NoEcho, _) => Heard::Silence,
            _ => return None,
        };
        Some(Beam { azimuth_deg, heard })
    };
    Some((0..BEAMS).filter_map(beam).collect())
}

/// A place with room about it, within the extent of the walls.
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
