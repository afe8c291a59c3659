//! The fan of rays converges to the same echoes as its spacing decreases.

use super::*;
use crate::{
    acoustics::{Air, Sensor},
    geometry::{Pose, wrap_pi},
    model::{Arrival, EngineOptions, FanOptions, ObservationPoint, Options, Simulator},
    scene::shipped,
};

/// A simulator with one of the engines for the same ranger in a scene.
fn simulator(scene: &Arc<Scene>, engine: EngineOptions) -> Simulator {
    let options = Options { max_range_m: Some(2.5), ..engine.into() };
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    Simulator::new(scene.clone(), sensor, Air::default(), options).expect("valid options")
}

/// Mirror echoes above the threshold; the fan's ranger is transparent.
fn mirrored(point: &ObservationPoint, pose: &Pose, azimuth_deg: f64) -> Vec<Arrival> {
    let mut arrivals = point.arrivals(pose.direction_rad(azimuth_deg)).expect("few paths");
    arrivals.retain(|arrival| {
        arrival.path.kind() == PathKind::Specular
            && arrival.amplitude > 0.02
            && arrival
                .path
                .mechanisms()
                .all(|mechanism| mechanism != crate::model::Mechanism::Transducer)
    });
    arrivals
}

fn is_same(a: &Arrival, b: &Arrival) -> bool {
    (a.length_m - b.length_m).abs() < 1e-3
        && wrap_pi(a.departure_rad - b.departure_rad).abs() < 0.01
        && (a.amplitude / b.amplitude - 1.0).abs() < 0.05
}

/// Number of echoes of `paths`, of those that the fan finds, and of the fan's additional ones.
fn agreement(scene: &Arc<Scene>, pose: &Pose, ray_spacing_deg: f64) -> (usize, usize, usize) {
    let exact = simulator(scene, EngineOptions::default());
    let fan = simulator(scene, FanOptions { ray_spacing_deg, ..FanOptions::default() }.into());
    let [exact, fan] = [&exact, &fan].map(|simulator| simulator.at(pose.position()));
    let (mut all, mut found, mut extra) = (0, 0, 0);
    for azimuth in 0..12 {
        let azimuth_deg = 30.0 * f64::from(azimuth) + 1.0;
        let (exact, fan) = (mirrored(&exact, pose, azimuth_deg), mirrored(&fan, pose, azimuth_deg));
        all += exact.len();
        found += exact.iter().filter(|e| fan.iter().any(|f| is_same(f, e))).count();
        extra += fan.iter().filter(|f| !exact.iter().any(|e| is_same(f, e))).count();
    }
    (all, found, extra)
}

#[test]
fn converges_to_exact_paths() {
    let (mut all, mut found, mut more) = (0, 0, 0);
    for name in shipped::names() {
        let scene = Scene::from_json(shipped::text(name).expect("shipped")).expect("valid");
        for (pose_name, pose) in &scene.poses {
            let plan = Arc::new(scene.with_robot_at(pose));
            let round = !plan.cylinders.is_empty();
            let finest_deg = if round { 0.001 } else { 0.1 };
            let steps = [2.0, 0.5, finest_deg].map(|spacing| agreement(&plan, pose, spacing));
            println!("{name}, {pose_name}: (echoes, found, more) {steps:?}");
            assert!(steps[0].1 <= steps[1].1 && steps[1].1 <= steps[2].1, "{name}, {pose_name}");
            let finest = steps[2];
            if round {
                // Rays that graze a cylinder spread so much that even these are far apart, and the
                // fan's face is wide: it detects sound past the body that its middle does not.
                assert!(finest.1 as f64 >= 0.98 * finest.0 as f64, "{name}, {pose_name}");
                continue;
            }
            all += finest.0;
            found += finest.1;
            more += finest.2;
        }
    }
    assert!(all > 80, "{all}");
    assert_eq!((found, more), (all, 0));
}
