//! Derivatives by changes of walls and cylinders against finite differences.

use std::collections::BTreeMap;

use sonard_model::{
    geometry::{DVec2, Mirror, Pose},
    model::{Arrival, Interaction, Mechanism, Reflector},
    scene::Scene,
};

use super::{
    derivatives::{at, compare},
    shipped, world,
};
use crate::{EndOfWall, Parameter, PostPart, World, length_derivative, walls};

/// A shipped scene as drawn: the model squares corners that are turned by less than 0.1 mm.
fn unsquared(scene: &str) -> (World, Pose) {
    let (mut here, pose) = at(scene);
    let mut drawn = Scene::clone(&here.scene);
    drawn.snap_m = 0.0;
    here.scene = drawn.into();
    (here, pose)
}

/// Compares derivatives by a parameter with finite differences in a world; returns the number of
/// compared arrivals.
fn compare_parameter(name: &str, (here, pose): &(World, Pose), parameter: &Parameter) -> usize {
    compare(
        &format!("{name}, {parameter}"),
        |by| (here.changed(&[(parameter, by)]).expect("a world"), *pose),
        |world, _| world.steady_motion(parameter).expect("moves"),
    )
}

#[test]
fn turned_walls() {
    let mut compared = 0;
    for scene in ["simple-room", "oblique-corner", "two-surface-room"] {
        let here = unsquared(scene);
        for wall in 0..here.0.scene.walls.len() {
            compared += compare_parameter(scene, &here, &Parameter::WallTurn(wall));
        }
    }
    assert!(compared > 500, "{compared}");
}

#[test]
fn moved_ends() {
    let mut compared = 0;
    for scene in ["simple-room", "oblique-corner", "two-surface-room"] {
        let here = unsquared(scene);
        for wall in 0..here.0.scene.walls.len() {
            for end in [EndOfWall::A, EndOfWall::B] {
                compared += compare_parameter(scene, &here, &Parameter::WallEnd(wall, end));
            }
        }
    }
    assert!(compared > 1000, "{compared}");
}

/// A body, and a leg that diffracts as a whole, before walls with floor and ceiling.
#[test]
fn moved_and_grown_posts() {
    let text = r#"{"name": "legs", "materials": {"wood": {"reflectance": 0.95}},
        "walls": [{"id": "w", "polyline": [[0, 0], [4, 0], [4, 3], [0, 3]], "closed": true, "material": "wood"}],
        "cylinders": [{"id": "c", "center": [2.5, 1.0], "radius_m": 0.1, "material": "wood"},
            {"id": "d", "center": [1.6, 1.9], "radius_m": 0.012, "material": "wood"}],
        "floor_z_m": 0.0, "ceiling_z_m": 2.5,
        "poses": {"here": {"x_m": 1.0, "y_m": 1.2, "heading_deg": 20}}}"#;
    let mut here = world("simple-room", "senscomp-6500");
    here.scene = Scene::from_json(text).expect("a scene").into();
    here.options.max_range_m = Some(2.5);
    let pose = here.scene.poses["here"];
    let mut compared = 0;
    for post in 0..2 {
        for part in [PostPart::X, PostPart::Y, PostPart::Radius] {
            compared +=
                compare_parameter("legs", &(here.clone(), pose), &Parameter::Post(post, part));
        }
    }
    assert!(compared > 100, "{compared}");
}

#[test]
fn corners_follow_their_walls() {
    let scene = shipped("simple-room");
    let mut room = Scene::clone(&scene);
    let by = walls::WallChange { offset_m: 0.02, turn_rad: 0.03, longer_m: [0.0; 2] };
    for wall in 0..room.walls.len() {
        let moved = walls::moved_ends(&scene, &[(wall, by)]);
        for (at, ends) in moved.iter().enumerate() {
            (room.walls[at].a, room.walls[at].b) = (ends[0], ends[1]);
        }
        // What was joined is joined.
        let joints = |scene: &Scene| {
            let ends: Vec<DVec2> = scene.walls.iter().flat_map(|wall| [wall.a, wall.b]).collect();
            let joined = |a: usize| (0..ends.len()).filter(move |b| a < *b).map(move |b| (a, b));
            let near = |(a, b): &(usize, usize)| ends[*a].distance(ends[*b]) < 1e-6;
            (0..ends.len()).flat_map(joined).filter(near).collect::<Vec<_>>()
        };
        assert_eq!(joints(&room), joints(&scene), "wall {wall}");
        assert!(!joints(&scene).is_empty());
    }
}

/// One-way length of a ray from a place, in a direction, reflected by walls in turn to the last.
fn ray_m(scene: &Scene, from: DVec2, direction: DVec2, walls: &[u32]) -> f64 {
    let (mut at, mut along, mut length_m) = (from, direction, 0.0);
    for &wall in walls {
        let wall = &scene.walls[wall as usize];
        let mirror = Mirror::through(wall.a, wall.b);
        let leg_m = -mirror.signed_distance_m(at) / mirror.normal.dot(along);
        at += leg_m * along;
        along = mirror.image_of_direction(along);
        length_m += leg_m;
    }
    length_m
}

/// Scattered paths of all orders against rays in their directions, by moved, turned and lengthened
/// walls and a moved ranger.
#[test]
fn scattered_paths() {
    let text = r#"{"name": "yard", "materials": {"brick": {"reflectance": 0.9, "roughness": 0.4}},
        "walls": [{"id": "w", "polyline": [[0, 0], [3, 0], [2.9, 2.2], [0.1, 2]], "closed": true,
        "material": "brick"}], "floor_z_m": 0.0, "ceiling_z_m": 0.7}"#;
    let mut here = world("simple-room", "senscomp-6500");
    here.scene = Scene::from_json(text).expect("a scene").into();
    here.options.max_range_m = Some(3.0);
    let pose = Pose { x_m: 1.1, y_m: 0.7, heading_deg: 0.0 };
    let simulator = here.simulator(&pose).expect("a model");
    let z_m = simulator.sensor_z_m().expect("heights");
    let walls = 0..here.scene.walls.len();
    let of_walls = walls.flat_map(|wall| {
        [
            Parameter::Wall(wall),
            Parameter::WallTurn(wall),
            Parameter::WallEnd(wall, EndOfWall::A),
            Parameter::WallEnd(wall, EndOfWall::B),
        ]
    });
    let parameters: Vec<Parameter> =
        of_walls.chain([Parameter::X(0), Parameter::Y(0), Parameter::Height]).collect();
    let mut compared: BTreeMap<usize, u32> = BTreeMap::new();
    for step in 0..24 {
        let direction_rad = 15f64.to_radians() * f64::from(step);
        let arrivals = simulator.at(pose.position()).arrivals(direction_rad).expect("paths");
        for arrival in arrivals {
            let is_strip =
                |met: &Interaction| matches!(met.mechanism, Mechanism::Scattering { .. });
            let Some(strip) = arrival.path.interactions.iter().position(is_strip) else { continue };
            for parameter in &parameters {
                let expected = by_rays(&here, &pose, &arrival, strip, parameter);
                let motion = here.steady_motion(parameter).expect("moves");
                let ends = [pose.position(); 2];
                let found = length_derivative(&arrival.path, ends, z_m, &here.scene, &motion);
                let error = (found - expected).abs();
                assert!(error < 1e-5, "{parameter}: {found} for {expected} of {arrival:?}");
                *compared.entry(arrival.path.order().min(1)).or_default() += 1;
            }
        }
    }
    assert!(compared.len() == 2 && compared.values().all(|count| *count > 1000), "{compared:?}");
}

/// Finite difference of the length of a scattered path in its direction of departure.
fn by_rays(
    here: &World,
    pose: &Pose,
    arrival: &Arrival,
    strip: usize,
    parameter: &Parameter,
) -> f64 {
    const BY: f64 = 1e-6;
    let interactions = &arrival.path.interactions;
    let surfaces = interactions.iter().take(strip + 1).filter_map(|met| match met.mechanism {
        Mechanism::Reflection(Reflector::Wall(wall)) | Mechanism::Scattering { wall } => Some(wall),
        _ => None,
    });
    let surfaces: Vec<u32> = surfaces.collect();
    let bounce = |met: &&Interaction| {
        matches!(met.mechanism, Mechanism::Reflection(Reflector::Floor | Reflector::Ceiling))
    };
    let limits: Vec<f64> = interactions.iter().filter(bounce).filter_map(|met| met.z_m).collect();
    let length_m = |by: f64| {
        let world = here.changed(&[(parameter, by)]).expect("a world");
        let along = match parameter {
            Parameter::X(_) => DVec2::X,
            Parameter::Y(_) => DVec2::Y,
            _ => DVec2::ZERO,
        };
        let from = pose.position() + by * along;
        let direction = DVec2::from_angle(arrival.departure_rad);
        let plan_m = 2.0 * ray_m(&world.scene, from, direction, &surfaces);
        // The height of the image by floor and ceiling, in turn.
        let z_m = world.sensor_z_m().expect("heights");
        let image_m = limits.iter().fold(z_m, |image_m, limit_m| 2.0 * limit_m - image_m);
        plan_m.hypot(image_m - z_m)
    };
    (length_m(BY) - length_m(-BY)) / (2.0 * BY)
}
