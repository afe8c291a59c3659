//! Random rooms, and a robot's course through one.

use std::sync::Arc;

use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::{Arrangement, SimulatedCourse, TrialSettings, random_room};
use sonard_interpret::interpret::grid::Trust;
use sonard_model::{
    acoustics::{Air, Sensor},
    array::RangerArray,
    geometry::{DVec2, distance_to_segment},
    model::{ConeOptions, Simulator},
    scene::{Scene, Wall},
};

fn sides<'a>(scene: &'a Scene, outline: &'a str) -> Vec<&'a Wall> {
    let belongs = |wall: &&Wall| wall.id.split('.').next() == Some(outline);
    scene.walls.iter().filter(belongs).collect()
}

fn distance_m(first: &Wall, second: &Wall) -> f64 {
    let ends = |from: &Wall, to: &Wall| {
        distance_to_segment(from.a, to.a, to.b).min(distance_to_segment(from.b, to.a, to.b))
    };
    ends(first, second).min(ends(second, first))
}

#[test]
fn boxes_leave_free_passages() {
    let mut boxes = 0;
    for seed in 0..60 {
        let scene = random_room("r", 3, 0, &mut Pcg64::seed_from_u64(seed));
        let names = ["room", "box-0", "box-1", "box-2"];
        let outlines = names.map(|name| sides(&scene, name));
        let start = scene.poses["start"].position();
        for (at, one) in outlines.iter().enumerate() {
            assert!(one.is_empty() || one.len() == 4, "{seed}: {one:?}");
            let gaps = outlines[..at].iter().flatten();
            let pairs = gaps.flat_map(|other| one.iter().map(|wall| distance_m(wall, other)));
            assert!(pairs.fold(f64::INFINITY, f64::min) > 0.6, "{seed}");
            if at > 0 {
                boxes += usize::from(!one.is_empty());
                let off = one.iter().map(|wall| distance_to_segment(start, wall.a, wall.b));
                assert!(off.fold(f64::INFINITY, f64::min) > 1.3, "{seed}");
                let half = one.iter().map(|wall| wall.a.distance(wall.b) / 2.0);
                assert!(half.into_iter().all(|m| (0.15..0.4).contains(&m)), "{seed}");
            }
        }
    }
    assert!(boxes > 100, "{boxes} boxes in 60 rooms");
}

#[test]
fn partitions_are_spaced_evenly() {
    let mut found = 0;
    for seed in 0..60 {
        let scene = random_room("r", 0, 2, &mut Pcg64::seed_from_u64(seed));
        let room = sides(&scene, "room");
        let (along, up) = (room[0].b - room[0].a, room[1].b - room[1].a);
        assert!((3.5..6.5).contains(&along.length()) && (3.0..5.0).contains(&up.length()));
        for (number, name) in ["partition-0", "partition-1"].into_iter().enumerate() {
            let Some(wall) = sides(&scene, name).first().copied() else { continue };
            found += 1;
            let share = |at: DVec2, side: DVec2| at.dot(side) / side.length_squared();
            // Nominally at a third and two thirds, within a tenth; alternately from below and
            // above.
            let place = 3.0 * share(wall.a, along) - (number as f64 + 1.0);
            assert!(place.abs() <= 0.1 + 1e-9, "{seed} {name}: {place}");
            assert!((share(wall.a, up) - number as f64).abs() < 1e-9, "{seed} {name}");
            let long = (share(wall.b, up) - share(wall.a, up)).abs();
            assert!((0.35..0.6).contains(&long), "{seed} {name}: {long}");
        }
    }
    assert!(found > 60, "{found} partitions in 60 rooms");
}

#[test]
fn robot_drives_ahead_clear_of_walls() {
    let text = sonard_model::scene::shipped::text("two-surface-room").expect("shipped");
    let scene = Arc::new(Scene::from_json(text).expect("a scene"));
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let simulator =
        Simulator::new(scene.clone(), sensor, Air::default(), ConeOptions::default().into())
            .expect("a model");
    let array = RangerArray::preset("ring-12").expect("an array");
    let settings = TrialSettings {
        resolution_m: 0.05,
        places: 60,
        stride_m: 0.2,
        clearance_m: 0.3,
        arrangement: Arrangement::Ring(Box::new(array)),
        range_sigma_m: 0.0,
        exponent: 2.0,
        extend_m: 2.0,
        trust: Trust::default(),
    };
    let mut rng = Pcg64::seed_from_u64(4);
    let through = |start, rng: &mut Pcg64| {
        SimulatedCourse::through(&simulator, start, &settings, rng).expect("few paths")
    };
    let course = through(DVec2::new(1.2, 1.0), &mut rng).expect("a course");
    assert_eq!(course.sweeps.len(), 60);
    let mut moves = 0;
    for pair in course.sweeps.windows(2) {
        let [from, to] = [&pair[0].pose, &pair[1].pose];
        assert!(scene.clearance_m(to.position()) >= 0.3, "{to:?}");
        let stride = to.position() - from.position();
        if stride.length() > 1e-9 {
            moves += 1;
            let is_stride = [0.2, 0.06].iter().any(|m| (stride.length() - m).abs() < 1e-9);
            assert!(is_stride, "{from:?} {to:?}");
            let ahead = DVec2::from_angle(to.direction_rad(0.0));
            assert!(stride.normalize().distance(ahead) < 1e-9, "{from:?} {to:?}");
        }
    }
    assert!(moves > 40, "{moves} moves");
    // A start within the clearance of a wall is moved to the nearest allowed position.
    assert!(through(DVec2::new(0.2, 0.2), &mut rng).is_some());
}
