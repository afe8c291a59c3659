//! Laws that hold in any scene.

use proptest::prelude::*;

use super::*;
use crate::{
    model::{Mechanism, Prediction},
    scan_plan::ScanPlan,
};

/// A room with a slanted partition and a post, and a place in it.
fn room() -> (Scene, DVec2) {
    let mut room = scene(vec![
        wall("south", (0.0, 0.0), (2.1, 0.0), 0.9),
        wall("east", (2.1, 0.0), (2.3, 1.7), 0.9),
        wall("north", (2.3, 1.7), (0.1, 1.6), 0.9),
        wall("west", (0.1, 1.6), (0.0, 0.0), 0.9),
        wall("partition", (1.2, 0.5), (1.5, 0.9), 0.9),
    ]);
    room.cylinders = vec![cylinder((0.5, 1.2), 0.06)];
    (room, DVec2::new(0.71, 0.53))
}

/// The scene with every point moved.
fn moved(mut scene: Scene, to: impl Fn(DVec2) -> DVec2) -> Scene {
    for wall in &mut scene.walls {
        (wall.a, wall.b) = (to(wall.a), to(wall.b));
    }
    for cylinder in &mut scene.cylinders {
        cylinder.center = to(cylinder.center);
    }
    scene
}

/// Strong arrivals by path. Weak ones, and paths that only graze the receiver, may come and go with
/// the grid of rays, which is fixed in the world.
fn loud(scene: Scene, from: DVec2, direction_rad: f64) -> Vec<(Vec<Mechanism>, f64, f64)> {
    let options = Options { max_range_m: Some(2.0), ..BARE.into() };
    let simulator = simulator(scene, options);
    let mut all: Vec<_> = simulator
        .at(from)
        .arrivals(direction_rad)
        .expect("few paths")
        .into_iter()
        .filter(|arrival| arrival.amplitude > 0.05)
        .map(|arrival| (arrival.path.mechanisms().collect(), arrival.length_m, arrival.amplitude))
        .collect();
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    all
}

fn same(one: &[(Vec<Mechanism>, f64, f64)], other: &[(Vec<Mechanism>, f64, f64)]) {
    assert_eq!(one.len(), other.len(), "{one:#?} {other:#?}");
    for (path, length_m, amplitude) in one {
        let twin = other.iter().find(|(twin, ..)| twin == path).expect("the same path");
        close(*length_m, twin.1, 1e-4, "length");
        close(*amplitude, twin.2, 2e-2 * amplitude, "amplitude");
    }
}

#[test]
fn rigid_motions_change_nothing() {
    let (room, from) = room();
    for direction_deg in [10.0_f64, 140.0, 265.0] {
        let direction_rad = direction_deg.to_radians();
        let here = loud(room.clone(), from, direction_rad);
        assert!(!here.is_empty(), "{direction_deg}");
        let shift = DVec2::new(-3.0, 17.25);
        same(&here, &loud(moved(room.clone(), |p| p + shift), from + shift, direction_rad));
        for turn_rad in [0.4_f64, 2.0, -1.1] {
            let turn = DVec2::from_angle(turn_rad);
            let turned = moved(room.clone(), |p| turn.rotate(p));
            same(&here, &loud(turned, turn.rotate(from), direction_rad + turn_rad));
        }
    }
}

#[test]
fn mirrored_scene() {
    let (room, from) = room();
    let mirror = |p: DVec2| DVec2::new(-p.x, p.y);
    for direction_deg in [10.0_f64, 140.0, 265.0] {
        let direction_rad = direction_deg.to_radians();
        let here = loud(room.clone(), from, direction_rad);
        let there =
            loud(moved(room.clone(), mirror), mirror(from), std::f64::consts::PI - direction_rad);
        same(&here, &there);
    }
}

#[test]
fn arrivals_match_the_appendix() {
    use crate::{
        acoustics::BeamPattern,
        model::{Engine as _, Fan, FanSettings},
    };
    let (room, from) = room();
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let settings = FanSettings {
        spacing_rad: 0.2_f64.to_radians(),
        half_face_m: 0.0193,
        wavelength_m: 0.007,
        absorption_db_per_m: 1.6,
        max_path_m: 6.0,
        min_amplitude: 1e-4,
        max_order: u32::MAX,
    };
    let fan = Fan::new(&room, BeamPattern::new(&sensor, 343.99), settings);
    let arrivals = fan.arrivals_at(from).expect("few paths");
    for direction_deg in (0..360).step_by(5) {
        let direction_rad = f64::from(direction_deg).to_radians();
        for (shortest_m, threshold) in [(0.0, 0.02), (0.818, 0.02), (1.5, 0.1)] {
            let first = fan.first_echo(from, direction_rad, shortest_m, threshold);
            let of_all = arrivals
                .arrivals(direction_rad)
                .into_iter()
                .find(|arrival| arrival.length_m >= shortest_m && arrival.amplitude >= threshold);
            match (&first, &of_all) {
                (None, None) => {}
                (Some(first), Some(of_all)) => {
                    close(first.length_m, of_all.length_m, 2e-3, &format!("{direction_deg}"));
                }
                _ => panic!("{direction_deg}: {first:?} but {of_all:?}"),
            }
        }
    }
}

/// Flat walls only: exactly. Sound reflected by a round body spreads so much that two adjacent rays
/// soon hit different walls, and a fan of any spacing misses some paths.
#[test]
fn finer_fan_reads_the_same() {
    let plan = ScanPlan { step_deg: 1.8, ..ScanPlan::default() };
    for name in shipped::names() {
        let scene = shipped_scene(name);
        for (pose_name, pose) in &scene.poses {
            let read = |ray_spacing_deg: f64| {
                let fan = FanOptions { ray_spacing_deg, ..FanOptions::default() };
                let options = Options { max_range_m: Some(6.0), ..fan.into() };
                simulator(scene.with_robot_at(pose), options)
                    .predict(pose, &plan)
                    .expect("few paths")
            };
            let default = read(FanOptions::default().ray_spacing_deg);
            let mut other_path = 0;
            for (one, other) in default.iter().zip(read(0.021)) {
                if met_round_body(one) || met_round_body(&other) {
                    other_path += usize::from(range_differs(one, &other, 1e-3));
                } else {
                    let what = format!("{name} {pose_name}: {one:?} {other:?}");
                    assert_eq!(one.status, other.status, "{what}");
                    assert!(!range_differs(one, &other, 1e-9), "{what}");
                }
            }
            assert!(other_path * 10 < default.len(), "{name} {pose_name}: {other_path} beams");
        }
    }
}

fn met_round_body(prediction: &Prediction) -> bool {
    let mut reflectors = prediction.arrival.iter().flat_map(|arrival| arrival.path.reflectors());
    reflectors.any(|reflector| matches!(reflector, Reflector::Cylinder(_)))
}

fn range_differs(a: &Prediction, b: &Prediction, tolerance_m: f64) -> bool {
    match (a.range_m, b.range_m) {
        (Some(one_m), Some(other_m)) => (one_m - other_m).abs() > tolerance_m,
        (a, b) => a.is_some() != b.is_some(),
    }
}

#[test]
fn absorption_in_decibels() {
    let (room, from) = room();
    let lossless = simulator(room.clone(), BARE);
    let lossy = simulator(room, FanOptions { lossless: false, ..BARE });
    let decibels_per_m = Air::default().absorption_db_per_m(49.4e3);
    let (lossless, lossy) = (lossless.at(from), lossy.at(from));
    for direction_deg in (0..360).step_by(15) {
        let direction_rad = f64::from(direction_deg).to_radians();
        let all = lossless.arrivals(direction_rad).expect("few paths");
        for arrival in lossy.arrivals(direction_rad).expect("few paths") {
            let twin = all.iter().find(|twin| twin.path == arrival.path).expect("a lossless echo");
            let left = 10f64.powf(-decibels_per_m * arrival.length_m / 20.0);
            close(arrival.amplitude, twin.amplitude * left, 1e-9, "amplitude");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Nothing flat exceeds a head-on wall, and a lower reflectance never gives a stronger echo.
    #[test]
    fn amplitude_grows_with_reflectance(
        ends in proptest::collection::vec(((-2.0..2.0f64, -2.0..2.0f64), (-2.0..2.0f64, -2.0..2.0f64)), 1..6),
        dull in 0.3..1.0f64,
        direction_deg in 0.0..360.0f64,
    ) {
        let walls = |reflectance: f64| {
            ends.iter()
                .filter(|(a, b)| DVec2::from(*a).distance((*b).into()) > 0.01)
                .map(|&(a, b)| wall("w", a, b, reflectance))
                .collect::<Vec<_>>()
        };
        let options = Options {
            max_range_m: Some(2.5),
            ..FanOptions { ray_spacing_deg: 0.5, ..BARE }.into()
        };
        let arrivals_with = |reflectance| arrivals(scene(walls(reflectance)), options, DVec2::ZERO, direction_deg);
        let bright = arrivals_with(1.0);
        for arrival in &bright {
            prop_assert!(arrival.amplitude <= 1.0 + 1e-6, "{arrival:?}");
        }
        for arrival in arrivals_with(dull) {
            let twin = bright.iter().find(|twin| twin.path == arrival.path);
            prop_assert!(twin.is_some_and(|twin| twin.amplitude >= arrival.amplitude - 1e-12), "{arrival:?}");
        }
    }
}
