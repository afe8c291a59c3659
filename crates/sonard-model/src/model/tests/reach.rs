//! Paths up to a length give the same results as all paths.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::{
    acoustics::{Air, Latch, Sensor},
    geometry::DVec2,
    model::{Options, PathOptions, Simulator},
    scene::{Scene, shipped},
};

/// Compares pings of one point by the nearest deciding echoes with pings by all echoes.
fn check(scene: &str, sensor: &str, options: Options) {
    let text = shipped::text(scene).expect("a shipped scene");
    let scene = Arc::new(Scene::from_json(text).expect("a valid scene"));
    let sensor = Sensor::preset(sensor).expect("a preset");
    let simulator = Simulator::new(scene.clone(), sensor, Air::default(), options).expect("valid");
    let mut random = Pcg64::seed_from_u64(5);
    // Twice: the second search begins with the length required before.
    for pose in scene.poses.values().flat_map(|pose| [pose; 2]) {
        let off = DVec2::new(random.random_range(-0.02..0.02), random.random_range(-0.02..0.02));
        let point = simulator.at(pose.position() + off);
        for _ in 0..20 {
            let direction_rad = random.random_range(-3.1..3.1);
            assert_eq!(
                point.ping(direction_rad).expect("few paths"),
                point.ping_by_all(direction_rad, Latch::First).expect("few paths"),
                "{} {pose:?} {direction_rad}",
                scene.name
            );
            assert_eq!(
                point.ping_rearmed(direction_rad).expect("few paths"),
                point.ping_by_all(direction_rad, Latch::Rearmed).expect("few paths"),
                "{} {pose:?} {direction_rad}",
                scene.name
            );
        }
    }
}

#[test]
fn nearest_echoes_suffice() {
    for scene in [
        "simple-room",
        "corridor",
        "oblique-corner",
        "echo-traces",
        "plane-corner-edge",
        "mcgill-lab",
    ] {
        check(scene, "senscomp-6500", Options::default());
    }
    check(
        "simple-room-robot",
        "senscomp-6500",
        Options { max_range_m: Some(3.0), ..Options::default() },
    );
    let ideal = PathOptions { ideal_receiver: true, ..PathOptions::default() };
    check("simple-room", "senscomp-6500", ideal.into());
    check("plane-corner-edge", "bozma-kuc-60khz", Options::default());
    check("oblique-corner", "hc-sr04", Options::default());
}
