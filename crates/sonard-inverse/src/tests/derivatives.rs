//! Derivatives of path lengths and directions against finite differences.

use std::collections::{BTreeMap, BTreeSet};

use sonard_model::{
    geometry::{DVec2, Pose, wrap_pi},
    model::{Arrival, Mechanism},
    scene::Scene,
};

use super::{first_pose, shipped, world};
use crate::{
    Parameter, SceneMotion, World, bearing::Bearing, jacobian::material_rate_db, length_derivative,
    walls,
};

/// Half step of a finite difference, metres.
const BY_M: f64 = 1e-6;

type Key = Vec<Mechanism>;

/// Arrivals in a direction by their interactions; paths with identical interactions are omitted.
fn arrivals(world: &World, pose: &Pose, direction_rad: f64) -> BTreeMap<Key, Arrival> {
    let simulator = world.simulator(pose).expect("a model");
    let (mut found, mut twice) = (BTreeMap::new(), BTreeSet::new());
    for arrival in simulator.at(pose.position()).arrivals(direction_rad).expect("paths") {
        let key: Key = arrival.path.mechanisms().collect();
        // Scattering depends on the strip of wall under the beam, not on a stationary point.
        let is_left_out = key.iter().any(|met| matches!(met, Mechanism::Scattering { .. }));
        if is_left_out || found.insert(key.clone(), arrival).is_some() {
            twice.insert(key);
        }
    }
    twice.iter().for_each(|key| {
        found.remove(key);
    });
    found
}

/// Compares derivatives with finite differences for all arrivals in some directions; returns their
/// number.
pub(super) fn compare(
    name: &str,
    moved: impl Fn(f64) -> (World, Pose),
    motion: impl Fn(&World, f64) -> SceneMotion,
) -> usize {
    let (here, pose) = moved(0.0);
    let mut compared = 0;
    for step in 0..24 {
        let azimuth_deg = 15.0 * f64::from(step);
        let direction_rad = here.direction_rad(&pose, azimuth_deg);
        let ends = here.sensor.mounting.transducer_positions(pose.position(), direction_rad);
        let simulator = here.simulator(&pose).expect("a model");
        let z_m = simulator.sensor_z_m().unwrap_or(0.0);
        let [before, after] = [-BY_M, BY_M].map(|by| {
            let (world, pose) = moved(by);
            let direction_rad = world.direction_rad(&pose, azimuth_deg);
            arrivals(&world, &pose, direction_rad)
        });
        for (key, arrival) in arrivals(&here, &pose, direction_rad) {
            let (Some(before), Some(after)) = (before.get(&key), after.get(&key)) else { continue };
            let expected = (after.length_m - before.length_m) / (2.0 * BY_M);
            let motion = motion(&here, direction_rad);
            let rate = length_derivative(&arrival.path, ends, z_m, simulator.scene(), &motion);
            let error = (rate - expected).abs();
            assert!(error < 1e-5, "{name}: {rate} for {expected} of {key:?} at {azimuth_deg}");
            let directions = |of: &Arrival| [of.departure_rad, of.arrival_rad];
            let rates = Bearing::new(&arrival.path, ends, simulator.scene())
                .map_or([0.0; 2], |bearing| bearing.derivatives(simulator.scene(), &motion));
            for (end, rate) in rates.into_iter().enumerate() {
                let [before, after] = [before, after].map(|of| directions(of)[end]);
                let expected = wrap_pi(after - before) / (2.0 * BY_M);
                let error = (rate - expected).abs();
                let tolerance = 1e-4 * expected.abs().max(1.0);
                assert!(
                    error < tolerance,
                    "{name}: turns {rate} for {expected} of {key:?} at {azimuth_deg}"
                );
            }
            compared += 1;
        }
    }
    compared
}

pub(super) fn at(scene: &str) -> (World, Pose) {
    // Up to 3 m: up to four reflections in a room.
    let mut world = world(scene, "senscomp-6500");
    world.options.max_range_m = Some(3.0);
    let pose = first_pose(&shipped(scene));
    (world, Pose { heading_deg: 17.3, ..pose })
}

/// Derivatives of levels by material properties: reflected and scattered sound, and combinations.
#[test]
fn levels_by_materials() {
    let text = r#"{"name": "yard", "materials": {"brick": {"reflectance": 0.8, "roughness": 0.3},
        "glass": {"reflectance": 0.9}}, "walls": [
        {"id": "w", "polyline": [[0, 0], [3, 0], [3, 2]], "material": "brick"},
        {"id": "v", "polyline": [[3, 2], [0, 2], [0, 0]], "material": "glass"}]}"#;
    let mut here = world("simple-room", "senscomp-6500");
    here.scene = Scene::from_json(text).expect("a scene").into();
    here.options.max_range_m = Some(3.5);
    let pose = Pose { x_m: 1.1, y_m: 0.7, heading_deg: 0.0 };
    let strengths = |world: &World, direction_rad: f64| {
        let simulator = world.simulator(&pose).expect("a model");
        let arrivals = simulator.at(pose.position()).arrivals(direction_rad).expect("paths");
        let key = |arrival: &Arrival| {
            (arrival.path.mechanisms().collect::<Key>(), arrival.length_m.to_bits())
        };
        arrivals.into_iter().map(|of| (key(&of), of)).collect::<BTreeMap<_, _>>()
    };
    // Numbers of reflected and of scattered arrivals.
    let mut compared = [0; 2];
    for name in ["brick", "glass"] {
        let of = |kind: fn(String) -> Parameter| kind(name.to_owned());
        let roughness = (name == "brick").then(|| of(Parameter::Roughness));
        for parameter in [of(Parameter::Reflectance)].into_iter().chain(roughness) {
            const BY: f64 = 1e-3;
            let [before, after] =
                [-BY, BY].map(|by| here.changed(&[(&parameter, by)]).expect("a world"));
            for step in 0..24 {
                let direction_rad = 15f64.to_radians() * f64::from(step);
                let [before, after] =
                    [&before, &after].map(|world| strengths(world, direction_rad));
                for (key, arrival) in strengths(&here, direction_rad) {
                    let (Some(before), Some(after)) = (before.get(&key), after.get(&key)) else {
                        continue;
                    };
                    let expected =
                        20.0 * (after.path_amplitude / before.path_amplitude).log10() / (2.0 * BY);
                    let any = |kind: fn(&Mechanism) -> bool| key.0.iter().any(kind);
                    if any(|met| matches!(met, Mechanism::Diffraction(_))) {
                        continue;
                    }
                    let rate = material_rate_db(&parameter, &here.scene, &arrival.path);
                    let error = (rate - expected).abs();
                    assert!(error < 1e-3, "{parameter}: {rate} for {expected} of {key:?}");
                    let at = usize::from(any(|met| matches!(met, Mechanism::Scattering { .. })));
                    compared[at] += u32::from(rate != 0.0);
                }
            }
        }
    }
    assert!(compared.iter().all(|count| *count > 50), "{compared:?}");
}

#[test]
fn ranger_position() {
    let mut compared = 0;
    for scene in ["simple-room", "mcgill-lab", "oblique-corner", "corridor", "simple-room-robot"] {
        let (world, pose) = at(scene);
        let axes = [(Parameter::X(0), DVec2::X), (Parameter::Y(0), DVec2::Y)];
        for (parameter, along) in axes {
            compared += compare(
                scene,
                |by| {
                    let place = pose.position() + by * along;
                    (world.clone(), Pose { x_m: place.x, y_m: place.y, ..pose })
                },
                |world, _| world.steady_motion(&parameter).expect("moves"),
            );
        }
    }
    assert!(compared > 2000, "{compared}");
}

#[test]
fn mounting_and_heading() {
    let (mut world, pose) = at("simple-room");
    world.sensor.mounting.separation_m = 0.03;
    world.sensor.mounting.ahead_m = 0.04;
    world.options.max_range_m = Some(2.0);
    let mut compared = 0;
    for parameter in [Parameter::Ahead, Parameter::Left] {
        compared += compare(
            "mounting",
            |by| (world.changed(&[(&parameter, by)]).expect("a world"), pose),
            |world, direction_rad| {
                world.turning_motion(&parameter, direction_rad, 0.0).expect("moves")
            },
        );
    }
    // A thousandth of a degree per metre: the step is the same fraction of each.
    let scaled = |by: f64| Pose { heading_deg: pose.heading_deg + by, ..pose };
    compared += compare(
        "heading",
        |by| (world.clone(), scaled(by)),
        |world, direction_rad| {
            world.turning_motion(&Parameter::Heading(0), direction_rad, 0.0).expect("moves")
        },
    );
    assert!(compared > 200, "{compared}");
}

#[test]
fn transducer_height() {
    let (mut world, pose) = at("simple-room");
    let mut room = Scene::clone(&world.scene);
    (room.floor_z_m, room.ceiling_z_m) = (Some(0.0), Some(0.9));
    world.scene = room.into();
    world.options.max_range_m = Some(2.0);
    let usual_z_m = world.sensor_z_m().expect("heights");
    let moved = |by: f64| world.changed(&[(&Parameter::Height, by)]).expect("a world");
    assert_eq!(moved(0.1).sensor_z_m(), Some(usual_z_m + 0.1));
    // Off the middle, so that floor and ceiling differ.
    let compared = compare(
        "height",
        |by| (moved(0.1 + by), pose),
        |world, _| world.steady_motion(&Parameter::Height).expect("moves"),
    );
    assert!(compared > 100, "{compared}");
}

#[test]
fn walls_with_corners_and_edges() {
    let mut compared = 0;
    for scene in ["simple-room", "oblique-corner", "two-surface-room"] {
        let (world, pose) = at(scene);
        for wall in 0..world.scene.walls.len() {
            compared += compare(
                scene,
                |by| (world.changed(&[(&Parameter::Wall(wall), by)]).expect("a world"), pose),
                |world, _| world.steady_motion(&Parameter::Wall(wall)).expect("moves"),
            );
        }
    }
    assert!(compared > 500, "{compared}");
}

#[test]
fn moving_and_growing_cylinders() {
    let text = r#"{"name": "legs", "materials": {"wood": {"reflectance": 0.95}},
        "walls": [{"id": "w", "polyline": [[0, 0], [4, 0], [4, 3], [0, 3]], "closed": true, "material": "wood"}],
        "cylinders": [{"id": "c", "center": [2.5, 1.0], "radius_m": 0.1, "material": "wood"}],
        "floor_z_m": 0.0, "ceiling_z_m": 2.5,
        "poses": {"here": {"x_m": 1.0, "y_m": 1.2, "heading_deg": 20}}}"#;
    let scene = Scene::from_json(text).expect("a scene");
    let mut here = world("simple-room", "senscomp-6500");
    here.options.max_range_m = Some(2.5);
    let pose = scene.poses["here"];
    let of = |change: &dyn Fn(&mut Scene, f64), motion: SceneMotion| {
        compare(
            "cylinder",
            |by| {
                let mut moved = scene.clone();
                change(&mut moved, by);
                (World { scene: moved.into(), ..here.clone() }, pose)
            },
            |_, _| motion.clone(),
        )
    };
    let moving = |velocity: DVec2, growth: f64| SceneMotion {
        cylinders: vec![(0, velocity, growth)],
        ..SceneMotion::default()
    };
    let compared = of(&|scene, by| scene.cylinders[0].center.x += by, moving(DVec2::X, 0.0))
        + of(&|scene, by| scene.cylinders[0].center.y += by, moving(DVec2::Y, 0.0))
        + of(&|scene, by| scene.cylinders[0].radius_m += by, moving(DVec2::ZERO, 1.0));
    assert!(compared > 50, "{compared}");
}

#[test]
fn displaced_wall_keeps_other_lines() {
    let scene = shipped("simple-room");
    for wall in 0..scene.walls.len() {
        let change = walls::WallChange { offset_m: 0.05, ..Default::default() };
        let moved = walls::moved_ends(&scene, &[(wall, change)]);
        let normal = walls::normal(&scene.walls[wall]);
        let off = |point: DVec2| (point - scene.walls[wall].a).dot(normal);
        assert!(moved[wall].iter().all(|end| (off(*end) - 0.05).abs() < 1e-9), "{wall}");
        for (at, ends) in moved.iter().enumerate().filter(|(at, _)| *at != wall) {
            let other = &scene.walls[at];
            let off = |point: DVec2| (point - other.a).dot(walls::normal(other)).abs();
            assert!(ends.iter().all(|end| off(*end) < 1e-9), "{wall} moves the line of {at}");
        }
    }
}
