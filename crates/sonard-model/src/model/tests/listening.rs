//! Evaluating a firing once for all thresholds equals the detections of each receiver alone.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::{
    acoustics::{Air, Latch, PulseArrival, Sensor},
    geometry::DVec2,
    model::{Options, Simulator},
    reading::PingStatus,
    scene::{Scene, shipped},
};

/// Thresholds from the lowest up, and some of them again after higher ones, decibels above the
/// nominal one.
const BY_DB: [f64; 14] =
    [-12.0, -9.5, -7.0, -9.0, -4.1, -1.7, 2.3, -0.6, 0.0, 0.8, 6.2, 2.9, 10.4, 12.0];

/// Ranges agree to rounding, a fraction of a nanometre where false position ends.
const SAME_M: f64 = 1e-9;

/// Returns the number of compared detections.
fn check(scene: &str, sensor: &str, max_range_m: f64) -> usize {
    let text = shipped::text(scene).expect("a shipped scene");
    let scene = Arc::new(Scene::from_json(text).expect("a valid scene"));
    let sensor = Sensor::preset(sensor).expect("a preset");
    let options = Options { max_range_m: Some(max_range_m), ..Options::default() };
    let simulator = Simulator::new(scene.clone(), sensor, Air::default(), options).expect("valid");
    let mut random = Pcg64::seed_from_u64(9);
    let mut compared = 0;
    for pose in scene.poses.values() {
        let off = DVec2::new(random.random_range(-0.02..0.02), random.random_range(-0.02..0.02));
        let point = simulator.at(pose.position() + off);
        for _ in 0..25 {
            let direction_rad = random.random_range(-3.1..3.1);
            let factors = BY_DB.map(|by_db| 10f64.powf(by_db / 20.0));
            let usual = simulator.receiver();
            let together = point.evaluate(direction_rad, |firing| {
                firing.evaluate_thresholds(usual, |listening| {
                    factors.map(|by| {
                        let rise = listening.first_rise(by, 0.0);
                        (rise, rise.map(|rise| listening.peak(&rise)))
                    })
                })
            });
            let together = together.expect("few paths");
            for ((rise, peak), by) in together.into_iter().zip(factors) {
                let mut receiver = usual.clone();
                receiver.threshold *= by;
                let alone = point
                    .evaluate(direction_rad, |firing| firing.detect(&receiver, Latch::First, 0.0));
                let alone = alone.expect("few paths");
                let place = format!("{} {pose:?} {direction_rad} {by}", scene.name);
                let status = rise.map_or(PingStatus::NoEcho, |rise| rise.status);
                assert_eq!(status, alone.status, "{place}");
                let Some((rise, (amplitude, margin_db))) = rise.zip(peak) else {
                    compared += 1;
                    continue;
                };
                // The same path may have another number in a search of greater length.
                let known = |arrival: PulseArrival| PulseArrival { index: 0, ..arrival };
                assert_eq!(rise.arrival.map(known), alone.arrival.map(known), "{place}");
                let off_m = rise.range_m - alone.range_m.expect("an echo");
                assert!(off_m.abs() < SAME_M, "{place}: {off_m}");
                let off = amplitude / alone.amplitude.expect("an echo") - 1.0;
                let off_db = margin_db - alone.margin_db.expect("an echo");
                assert!(off.abs() < 1e-7 && off_db.abs() < 1e-6, "{place}: {off_db} dB");
                compared += 1;
            }
        }
    }
    compared
}

#[test]
fn all_thresholds_at_once() {
    let mut compared = 0;
    for (scene, _) in shipped::SCENES {
        compared += check(scene, "senscomp-6500", 4.0);
    }
    compared += check("oblique-corner", "pioneer", 4.0);
    compared += check("corridor", "hc-sr04", 3.0);
    assert!(compared > 4000, "{compared}");
}
