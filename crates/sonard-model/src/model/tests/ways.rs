//! Ways through the floor plan: every path that the engine finds can be drawn.

use super::*;
use crate::{
    geometry::{Mirror, wrap_pi},
    model::{RecordedPath, paths::Paths},
};

/// Each way has the path's length, leaves and comes back in its directions, and at each flat
/// reflection the angles on both sides of the normal are equal.
#[test]
fn every_path_of_every_shipped_scene_has_its_way() {
    let mut drawn = 0;
    for name in shipped::names() {
        let scene = shipped_scene(name);
        for pose in scene.poses.values() {
            let scene = Arc::new(scene.with_robot_at(pose));
            let options = Options { max_range_m: Some(2.0), ..Options::default() };
            let sensor = Sensor::preset("senscomp-6500").expect("a preset");
            let simulator =
                Simulator::new(scene.clone(), sensor, Air::default(), options).expect("options");
            let paths = Paths::new(&scene, simulator.path_settings()).enumerate(pose.position());
            for echo in paths.iter().filter(|echo| echo.path.kind() != PathKind::Scattered) {
                let record = &echo.path;
                are_named(&echo.path, &scene);
                let points = RecordedPath::from(&echo.path)
                    .points(&scene, pose.position(), echo.length_m)
                    .unwrap_or_else(|| panic!("{name}: no way for {record:?}"));
                let [first, .., last] = points.as_slice() else { panic!("{record:?}") };
                assert_eq!((*first, *last), (pose.position(), pose.position()));
                let leaves = (points[1] - points[0]).to_angle();
                let comes = (points[points.len() - 2] - *last).to_angle();
                // The engine squares up corners, which moves them by a tenth of a millimetre. A way round
                // an edge reads the same backwards.
                let ends = [
                    (echo.departure_rad, echo.arrival_rad),
                    (echo.arrival_rad, echo.departure_rad),
                ];
                let fits = |(out, back): &(f64, f64)| {
                    wrap_pi(leaves - out).abs() < 1e-3 && wrap_pi(comes - back).abs() < 1e-3
                };
                let known = if bends(&echo.path).is_empty() { 1 } else { 2 };
                assert!(ends[..known].iter().any(fits), "{name} {record:?}");
                if bends(&echo.path).is_empty() {
                    mirrors(&scene, &echo.path, &points);
                }
                drawn += 1;
            }
        }
    }
    assert!(drawn > 1000, "{drawn}");
}

/// What a path meets is found again by its name.
fn are_named(path: &Path, scene: &Scene) {
    for wall in &reflectors(path) {
        assert_eq!(Reflector::named(scene, &wall.name(scene)), Some(*wall));
    }
    for bend in &bends(path) {
        assert_eq!(Bend::named(scene, &bend.name(scene)), Some(*bend));
    }
}

/// Ways up and down, over the rim of a low wall and round two edges, as the plan shows them; also for a
/// record that came from a log.
#[test]
fn ways_in_space_and_by_two_edges_are_drawn_in_the_plan() {
    let mut room = scene(vec![
        wall("low", (-2.0, 1.0), (2.0, 1.0), 1.0),
        wall("screen", (0.6, -0.9), (0.6, 0.3), 1.0),
        wall("plate", (-0.2, -0.5), (0.15, -0.55), 1.0),
    ]);
    (room.floor_z_m, room.ceiling_z_m) = (Some(0.0), Some(1.1));
    room.walls[0].z_m = Some([0.0, 0.3]);
    let room = Arc::new(room);
    let mut sensor = Sensor::preset("senscomp-6500").expect("a preset");
    sensor.mounting.z_m = Some(0.5);
    let options =
        Options { max_range_m: Some(1.5), double_diffraction: true, ..Options::default() };
    let simulator = Simulator::new(room.clone(), sensor, Air::default(), options).expect("options");
    let at = DVec2::new(0.1, 0.0);
    let settings = crate::model::paths::Settings { floor: 1e-4, ..simulator.path_settings() };
    let echoes = Paths::new(&room, settings).enumerate(at);
    let [mut rims, mut floors, mut twice] = [0; 3];
    for echo in &echoes {
        let record = &echo.path;
        are_named(&echo.path, &room);
        let is_level = |met: &Reflector| matches!(met, Reflector::Floor | Reflector::Ceiling);
        let upright = reflectors(&echo.path).iter().all(is_level);
        if upright && bends(&echo.path).is_empty() {
            continue;
        }
        let points = RecordedPath::from(&echo.path).points(&room, at, echo.length_m);
        let points = points.unwrap_or_else(|| panic!("no way for {record:?}"));
        let run_m = |points: &[DVec2]| -> f64 {
            points.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
        };
        let edge = record.bends().next().map(|bend| bend.name(&room));
        if edge.as_deref() == Some("low.top") {
            // As steep as it leaves up to the edge, as steep as it comes from there on.
            let [up, down] = echo.rise_rad.map(f64::cos);
            let bends = |at: &usize| {
                let (out, back) = (run_m(&points[..=*at]) / up, run_m(&points[*at..]) / down);
                (out + back - echo.length_m).abs() < 1e-6
            };
            assert!((1..points.len() - 1).any(|at| bends(&at)), "{record:?} {points:?}");
            rims += 1;
        } else {
            let rise_m = echo.rise_rad[0].sin() * echo.length_m;
            assert!((run_m(&points).hypot(rise_m) - echo.length_m).abs() < 1e-6, "{record:?}");
        }
        floors += usize::from(reflectors(record).contains(&Reflector::Floor));
        twice += usize::from(record.bends().count() > 1);
    }
    assert!(rims >= 4 && floors > 2 && twice > 2, "{rims} {floors} {twice}");
}

fn mirrors(scene: &Scene, path: &Path, points: &[DVec2]) {
    for (corner, reflector) in points.windows(3).zip(path.reflectors()) {
        let Reflector::Wall(index) = reflector else { continue };
        let wall = &scene.walls[index as usize];
        let turned = Mirror::through(wall.a, wall.b).turn(corner[1] - corner[0]);
        let (before, after) =
            (turned.normalize_or_zero(), (corner[2] - corner[1]).normalize_or_zero());
        // In a corner two reflections fall into one point, as nearly as its coordinates are written.
        if turned.length() > 2e-4 && corner[2].distance(corner[1]) > 2e-4 {
            assert!((before - after).length() < 1e-4, "{path:?} {points:?}");
        }
    }
}

#[test]
fn no_way_is_made_up() {
    let room = shipped_scene("simple-room");
    let path = RecordedPath {
        kind: PathKind::Specular,
        walls: [Some(Reflector::Wall(0))].into_iter().collect(),
        bends: Default::default(),
    };
    let at = DVec2::new(0.774, 0.085);
    assert!(path.points(&room, at, 0.17).is_some());
    assert_eq!(path.points(&room, at, 0.3), None, "not of that length");
    let missing = RecordedPath { walls: [Some(Reflector::Wall(99))].into_iter().collect(), ..path };
    assert_eq!(missing.points(&room, at, 0.17), None, "no such wall");
}
