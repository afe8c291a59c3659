//! Paths up to a length give the same results as all paths.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::{
    acoustics::{Air, Latch, Sensor},
    geometry::{DVec2, distance_to_segment},
    model::{ObservationPoint, Options, PathOptions, Simulator},
    scene::{Cylinder, Scene, Wall, shipped},
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

/// Scene with about half of the walls and cylinders at least `from_m` from a place removed, and with
/// walls added there.
fn changed_beyond(scene: &Scene, place: DVec2, from_m: f64, random: &mut Pcg64) -> Scene {
    let mut changed = scene.clone();
    let is_far = |[a, b]: [DVec2; 2]| distance_to_segment(place, a, b) >= from_m;
    changed.walls.retain(|wall| !is_far([wall.a, wall.b]) || random.random_bool(0.5));
    let gap_m = |cylinder: &Cylinder| cylinder.center.distance(place) - cylinder.radius_m;
    changed.cylinders.retain(|cylinder| gap_m(cylinder) < from_m || random.random_bool(0.5));
    let template = scene.walls[0].clone();
    for at in 0..3 {
        let mut point = || {
            let away_m = from_m + random.random_range(0.0..0.4);
            place + away_m * DVec2::from_angle(random.random_range(-3.1..3.1))
        };
        let [a, b] = [point(), point()];
        if is_far([a, b]) && a.distance(b) > 0.05 {
            changed.walls.push(Wall { id: format!("new-{at}").into(), a, b, ..template.clone() });
        }
    }
    changed
}

/// Changes of the scene outside the radius of a reading leave it as it is, and most readings have one.
#[test]
fn changes_outside_the_radius_leave_readings_as_they_are() {
    let mut random = Pcg64::seed_from_u64(11);
    let (mut compared, mut differing) = (0, 0);
    for name in ["simple-room", "corridor", "oblique-corner", "plane-corner-edge", "mcgill-lab"] {
        let text = shipped::text(name).expect("a shipped scene");
        let scene = Scene::from_json(text).expect("a valid scene");
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let options = Options { max_range_m: Some(4.0), ..Options::default() };
        let all = Simulator::new(Arc::new(scene.clone()), sensor, Air::default(), options)
            .expect("a valid scene");
        for pose in scene.poses.values() {
            for offset_m in [0.0, 0.0, 0.1].into_iter().cycle().take(90) {
                let direction_rad = random.random_range(-3.1..3.1);
                let offset = offset_m * DVec2::from_angle(direction_rad);
                let ping = |simulator: &Simulator| {
                    let point = simulator.at(pose.position());
                    point.ping_with_radius(direction_rad, offset).expect("few paths")
                };
                let (own, radius_m) = ping(&all);
                assert!(own.range_m.is_none_or(|range_m| range_m < radius_m + 1e-9), "{radius_m}");
                if !radius_m.is_finite() {
                    continue;
                }
                let changed =
                    changed_beyond(&scene, pose.position(), radius_m + 0.005, &mut random);
                differing += usize::from(changed != scene);
                let Ok(changed) = all.in_scene(Arc::new(changed)) else { continue };
                let (other, other_radius_m) = ping(&changed);
                let ranges_m = [own.range_m, other.range_m].map(|range_m| range_m.unwrap_or(0.0));
                let context = format!("{name} {pose:?} {direction_rad} {offset_m} {radius_m}");
                assert_eq!(own.status, other.status, "{context}");
                assert!((ranges_m[0] - ranges_m[1]).abs() < 1e-9, "{context}: {ranges_m:?}");
                assert!((radius_m - other_radius_m).abs() < 1e-9, "{context}: {other_radius_m}");
                compared += 1;
            }
        }
    }
    assert!(compared > 500 && differing > compared / 3, "{compared} {differing}");
}

/// Readings that the difference of the echoes does not affect are the same in a scene with one more
/// wall, also where that is near.
#[test]
fn unaffected_readings_are_the_same_in_a_changed_scene() {
    let mut random = Pcg64::seed_from_u64(12);
    let (mut all, mut same, mut unaffected) = (0, 0, 0);
    for name in ["simple-room", "corridor", "oblique-corner", "plane-corner-edge", "mcgill-lab"] {
        let text = shipped::text(name).expect("a shipped scene");
        let scene = Scene::from_json(text).expect("a valid scene");
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let options = Options { max_range_m: Some(4.0), ..Options::default() };
        let own = Simulator::new(Arc::new(scene.clone()), sensor, Air::default(), options)
            .expect("a valid scene");
        for pose in scene.poses.values().cycle().take(12) {
            let mut changed = scene.clone();
            let away = DVec2::from_angle(random.random_range(-3.1..3.1));
            let a = pose.position() + random.random_range(0.6..1.8) * away;
            let b = a + 0.2 * DVec2::from_angle(random.random_range(-3.1..3.1));
            changed.walls.push(Wall { id: "new".into(), a, b, ..scene.walls[0].clone() });
            let Ok(changed) = own.in_scene(Arc::new(changed)) else { continue };
            let points = [&own, &changed].map(|simulator| simulator.at(pose.position()));
            let echoes = [&points[0], &points[1]]
                .map(|point| point.echo_set(4.5).expect("few paths").expect("exact paths"));
            let change = echoes[0].change_to(&echoes[1]);
            for at in 0..90 {
                let direction_rad = (4.0 * f64::from(at) - 180.0).to_radians();
                let offset = f64::from(at % 2) * 0.1 * DVec2::from_angle(direction_rad);
                let ping = |point: &ObservationPoint| {
                    point.ping_with_radius(direction_rad, offset).expect("few paths")
                };
                let [(first, radius_m), (second, other_radius_m)] =
                    [ping(&points[0]), ping(&points[1])];
                let ranges_m = [&first, &second].map(|of| of.range_m.unwrap_or(0.0));
                let is_same = first.status == second.status
                    && (ranges_m[0] - ranges_m[1]).abs() < 1e-7
                    && (radius_m - other_radius_m).abs() < 1e-7;
                let is_affected = change.affects(direction_rad, radius_m);
                let context = format!("{name} {pose:?} {direction_rad} {first:?} {second:?}");
                assert!(is_same || is_affected, "{context}");
                all += 1;
                same += usize::from(is_same);
                unaffected += usize::from(!is_affected);
            }
        }
    }
    assert!(all - same > 50 && unaffected > same * 2 / 5, "{unaffected} {same} of {all}");
}
