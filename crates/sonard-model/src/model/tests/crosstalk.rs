//! Crosstalk between rangers, computed by hand, and compared with single rangers.

use std::sync::Arc;

use proptest::prelude::*;

use crate::{
    acoustics::{Air, Sensor},
    array::{FiringSlot, InterferingFiring, MountedRanger, RangerArray},
    geometry::Pose,
    model::{ArrayModel, Options, PathOptions, Prediction, Simulator},
    reading::PingStatus,
    scene::Scene,
};

const SPEED_M_S: f64 = 340.0;

fn air() -> Air {
    Air::default().with_sound_speed(SPEED_M_S).expect("in range")
}

/// A wall along x = `wall_m`, ten metres to each side.
fn wall(wall_m: f64) -> Scene {
    let scene = Scene::builder("wall").material("hard", 1.0);
    let scene = scene.walls("wall", &[[wall_m, -10.0], [wall_m, 10.0]], "hard");
    scene.build().expect("a scene")
}

/// Rangers that all point to +x, at these offsets to the left.
fn side_by_side(left_m: &[f64], interval_ms: f64, order: Vec<FiringSlot>) -> RangerArray {
    let ranger = |(number, &y_m): (usize, &f64)| MountedRanger {
        id: format!("s{number}"),
        x_m: 0.0,
        y_m,
        bearing_deg: 0.0,
        z_m: None,
    };
    RangerArray {
        name: "side-by-side".into(),
        description: String::new(),
        sensor: "senscomp-6500".into(),
        interval_ms,
        rangers: left_m.iter().enumerate().map(ranger).collect(),
        firing_order: order,
        body: None,
        sources: Default::default(),
    }
}

fn model(array: RangerArray, scene: &Scene, options: PathOptions) -> ArrayModel {
    let sensor = Sensor::preset(&array.sensor).expect("a preset");
    let options = PathOptions { ideal_receiver: true, lossless: true, ..options };
    ArrayModel::new(Arc::new(array), scene, &sensor, air(), options.into()).expect("right options")
}

fn predict(model: &ArrayModel, pose: Pose, firing: usize) -> Prediction {
    model.at(pose).expect("a pose").ping_in_round(firing).expect("few paths")
}

const ORIGIN: Pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };

/// Two sonars 0.2 m apart in front of a wall at 3 m. They fire alternately every 10 ms. At 10 ms s1
/// receives the sound that s0 sent at 0, over 2 x sqrt(9 + 0.01) = 6.00333 m. It appears as an echo
/// of 2.60333 m (3.4 m less): range 1.30167 m. Its own echo comes after its window of 1.7 m. Both
/// ends of the path are atan(0.1 / 3) off the axes, and the gain compensates 2.60333 of 6.00333 m.
#[test]
fn ghost_of_the_previous_slot() {
    let array = side_by_side(&[0.1, -0.1], 10.0, Vec::new());
    let model = model(array, &wall(3.0), PathOptions::default());
    let prediction = predict(&model, ORIGIN, 1);
    let length_m = 2.0 * f64::hypot(3.0, 0.1);
    assert_eq!(prediction.status, PingStatus::Echo);
    let range_m = prediction.range_m.expect("a range");
    assert!((range_m - 0.5 * (length_m - 3.4)).abs() < 1e-9, "{range_m}");
    let other = InterferingFiring { ranger: 0, before_us: 10_000.0 };
    assert_eq!(prediction.crosstalk, Some(other));
    let arrival = prediction.arrival.expect("an arrival");
    assert!((arrival.length_m - length_m).abs() < 1e-9, "{}", arrival.length_m);
    let one_way = model.simulator().beam().one_way(f64::atan2(0.1, 3.0));
    let expected = one_way * one_way * (length_m - 3.4) / length_m;
    let amplitude = prediction.amplitude.expect("an amplitude");
    assert!((amplitude - expected).abs() < 1e-9, "{amplitude} instead of {expected}");
    // Turned left: to the point of the wall half way between both.
    assert!((arrival.departure_rad - f64::atan2(-0.1, 3.0)).abs() < 1e-9);
    assert!((arrival.arrival_rad - f64::atan2(0.1, 3.0)).abs() < 1e-9);
}

#[test]
fn ghost_of_its_own_last_round() {
    let array = side_by_side(&[0.0], 10.0, Vec::new());
    let scene = wall(3.0);
    let prediction = predict(&model(array.clone(), &scene, PathOptions::default()), ORIGIN, 0);
    let range_m = prediction.range_m.expect("a ghost");
    assert!((range_m - 1.3).abs() < 1e-9, "{range_m}");
    assert_eq!(prediction.crosstalk, Some(InterferingFiring { ranger: 0, before_us: 10_000.0 }));
    let alone = PathOptions { without_crosstalk: true, ..PathOptions::default() };
    let prediction = predict(&model(array, &scene, alone), ORIGIN, 0);
    assert_eq!((prediction.status, prediction.crosstalk), (PingStatus::NoEcho, None));
}

/// Simultaneous firing: by way of the wall the path from the other is longer than the own one, so
/// each reads its own. Turned away until its beam pattern leaves a tenth of the wall's echo, s1
/// loses its own echo, to which the pattern applies twice, but not the other's sound, to which it
/// applies once.
#[test]
fn simultaneous_firing() {
    let together = vec![FiringSlot::Simultaneous(vec!["s0".into(), "s1".into()])];
    let mut array = side_by_side(&[0.1, -0.1], 100.0, together);
    let both = model(array.clone(), &wall(3.0), PathOptions::default());
    for firing in [0, 1] {
        let prediction = predict(&both, ORIGIN, firing);
        assert!((prediction.range_m.expect("a wall") - 3.0).abs() < 1e-9);
        assert_eq!(prediction.crosstalk, None);
    }
    let away_rad = both.simulator().beam().angle_at(0.1);
    assert!(
        0.05 > both.simulator().receiver().threshold
            && 0.01 < both.simulator().receiver().threshold
    );
    array.rangers[1].bearing_deg = -away_rad.to_degrees();
    let turned = model(array, &wall(3.0), PathOptions::default());
    let prediction = predict(&turned, ORIGIN, 1);
    assert_eq!(prediction.crosstalk, Some(InterferingFiring { ranger: 0, before_us: 0.0 }));
    let range_m = prediction.range_m.expect("the wall");
    assert!((range_m - f64::hypot(3.0, 0.1)).abs() < 1e-9, "{range_m}");
}

/// Two that face each other, 2 m apart, receive each other directly: half the distance.
#[test]
fn direct_path_of_facing_rangers() {
    let together = vec![FiringSlot::Simultaneous(vec!["s0".into(), "s1".into()])];
    let mut array = side_by_side(&[0.0, 0.0], 50.0, together);
    (array.rangers[1].x_m, array.rangers[1].bearing_deg) = (2.0, 180.0);
    let open = Scene::builder("open").build().expect("a scene");
    let prediction = predict(&model(array.clone(), &open, PathOptions::default()), ORIGIN, 1);
    assert!((prediction.range_m.expect("the other") - 1.0).abs() < 1e-9);
    let arrival = prediction.arrival.expect("an arrival");
    assert!(arrival.path.interactions.is_empty());
    assert!((arrival.amplitude - 1.0).abs() < 1e-9, "{}", arrival.amplitude);
    let between = model(array, &wall(1.5), PathOptions::default());
    let prediction = predict(&between, ORIGIN, 1);
    assert_eq!(prediction.crosstalk, None);
    assert!((prediction.range_m.expect("the wall") - 0.5).abs() < 1e-9);
}

/// Above a floor the direct path comes first, followed by its mirror image by the floor.
#[test]
fn direct_path_by_the_floor() {
    let together = vec![FiringSlot::Simultaneous(vec!["s0".into(), "s1".into()])];
    let mut array = side_by_side(&[0.0, 0.0], 100.0, together);
    (array.rangers[1].x_m, array.rangers[1].bearing_deg) = (2.0, 180.0);
    array.rangers.iter_mut().for_each(|ranger| ranger.z_m = Some(0.5));
    for wall_m in [None, Some(1.0)] {
        let mut scene =
            wall_m.map_or_else(|| Scene::builder("open").build().expect("a scene"), wall);
        scene.floor_z_m = Some(0.0);
        let model = model(array.clone(), &scene, PathOptions::default());
        let placed = model.at(ORIGIN).expect("a pose");
        let others = placed.others(1, 1).expect("crosstalk");
        let engine = others.engine;
        let (_, transmitter) = others.firings[0];
        let paths = engine.aimed([transmitter, others.receiver], 10.0, 1e-9).expect("few paths");
        let lengths_m: Vec<f64> = paths.arrivals().map(|arrival| arrival.length_m).collect();
        let straight = lengths_m.iter().any(|length_m| (length_m - 2.0).abs() < 1e-9);
        let by_floor = lengths_m.iter().any(|length_m| (length_m - 5.0_f64.sqrt()).abs() < 1e-9);
        // A wall of unlimited height hides both.
        assert_eq!((straight, by_floor), (wall_m.is_none(), wall_m.is_none()), "{lengths_m:?}");
    }
}

/// A ghost is an echo that the ranger alone would detect later, with a longer window: same paths,
/// apparently shorter, and weaker by the gain.
#[test]
fn ghosts_equal_a_longer_window() {
    let scene = Scene::from_json(crate::scene::shipped::text("mcgill-lab").expect("shipped"));
    let scene = scene.expect("a scene");
    let array = side_by_side(&[0.0], 12.0, Vec::new());
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let options = Options { max_range_m: None, ..PathOptions::default().into() };
    let model = ArrayModel::new(Arc::new(array), &scene, &sensor, air(), options);
    let model = model.expect("right options");
    let long = Options { max_range_m: Some(10.0), ..options };
    let single = Simulator::new(Arc::new(scene.clone()), sensor, air(), long).expect("right");
    let mut ghosts = 0;
    for step in 0..40 {
        let pose = Pose { x_m: 1.5, y_m: 1.5, heading_deg: 9.0 * f64::from(step) };
        let placed = model.at(pose).expect("a pose");
        let others = placed.others(0, 0).expect("crosstalk");
        let [(_, transmitter), ..] = others.firings[..] else { panic!("an earlier one") };
        let paths = others.engine.aimed([transmitter, others.receiver], 8.0, others.engine.floor());
        let paths = paths.expect("few paths");
        let strays: Vec<_> = paths.arrivals().collect();
        let all = single.at(pose.position()).arrivals(pose.direction_rad(0.0)).expect("few paths");
        // Strays exclude multiple echoes by the transducer's face, and rough walls scatter to the
        // ranger itself alone.
        let is_listed = |path: &crate::model::Path| {
            path.kind() != crate::reading::PathKind::Scattered
                && path
                    .mechanisms()
                    .all(|mechanism| mechanism != crate::model::Mechanism::Transducer)
        };
        for arrival in
            all.iter().filter(|arrival| arrival.length_m < 8.0 && is_listed(&arrival.path))
        {
            let found = strays.iter().any(|stray| {
                (stray.length_m - arrival.length_m).abs() < 1e-9
                    && (stray.amplitude - arrival.amplitude).abs() < 1e-9
            });
            assert!(found, "{step}: no stray like {arrival:?}");
            ghosts += 1;
        }
    }
    assert!(ghosts > 100, "{ghosts}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Paths between two rangers are reversible.
    #[test]
    fn crosstalk_is_reciprocal(
        places in prop::array::uniform2((0.4..2.6_f64, 0.4..2.1_f64, -180.0..180.0_f64)),
        tilted in prop::bool::ANY,
    ) {
        let scene = Scene::from_json(crate::scene::shipped::text("mcgill-lab").expect("shipped"));
        let mut scene = scene.expect("a scene");
        if tilted {
            (scene.floor_z_m, scene.ceiling_z_m) = (Some(0.0), Some(2.4));
        }
        let together = vec![FiringSlot::Simultaneous(vec!["s0".into(), "s1".into()])];
        let mut array = side_by_side(&[0.0, 0.0], 20.0, together);
        for (ranger, (x_m, y_m, bearing_deg)) in array.rangers.iter_mut().zip(places) {
            (ranger.x_m, ranger.y_m, ranger.bearing_deg) = (x_m, y_m, bearing_deg);
        }
        let can_stand =
            |ranger: &MountedRanger| scene.check_pose(&ranger.world_pose(&ORIGIN)).is_ok();
        prop_assume!(array.rangers.iter().all(can_stand));
        let model = model(array, &scene, PathOptions::default());
        let placed = model.at(ORIGIN).expect("a pose");
        let received = |firing: usize| {
            let others = placed.others(firing, firing).expect("crosstalk");
            let (_, transmitter) = others.firings[0];
            let ends = [transmitter, others.receiver];
            let paths = others.engine.aimed(ends, 6.0, others.engine.floor());
            let paths = paths.expect("few paths");
            let mut arrivals: Vec<_> = paths.arrivals().map(|arrival| (arrival, paths.arrival(&arrival))).collect();
            arrivals.retain(|(arrival, _)| arrival.amplitude > 1e-4);
            arrivals
        };
        let (there, back) = (received(1), received(0));
        prop_assert_eq!(there.len(), back.len());
        for (one, path) in &there {
            let same = back.iter().any(|(other, reverse)| {
                (one.length_m - other.length_m).abs() < 1e-9
                    && (one.amplitude - other.amplitude).abs() < 1e-9
                    && path.path.order() == reverse.path.order()
            });
            prop_assert!(same, "no reverse of {:?}", path);
        }
    }
}
