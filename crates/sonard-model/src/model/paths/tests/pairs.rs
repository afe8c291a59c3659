//! Separate transmitter and receiver.

use super::*;
use crate::{model::Reflector, scene::Cylinder};

const T: DVec2 = DVec2::new(0.3, 0.2);
const R: DVec2 = DVec2::new(0.7, 0.25);

/// Settings with echoes by several contacts down to the common floor.
fn to_the_floor() -> PathSettings {
    PathSettings { repeated_contact_ratio: 1.0, ..LOSSLESS }
}

/// A wall whose end is visible from both, and a cylinder.
fn plan() -> Scene {
    let mut plan = scene(&[[-5.0, -0.4, 5.0, -0.4], [0.4, 1.5, 0.4, 3.0]]);
    plan.cylinders = vec![Cylinder {
        id: Arc::from("round"),
        center: DVec2::new(1.9, 0.6),
        radius_m: 0.3,
        material: Material::RIGID,
        z_m: None,
    }];
    plan
}

#[test]
fn lengths_of_both_halves() {
    let settings =
        PathSettings { max_path_m: 6.0, edge_law: Some(EdgeLaw::Utd), floor: 1e-5, ..LOSSLESS };
    let echoes = Paths::new(&plan(), settings).enumerate_between(T, R).expect("few paths");
    let below = DVec2::new(R.x, -0.8 - R.y);
    let edge = DVec2::new(0.4, 1.5);
    let by_round = |p: DVec2, q: DVec2| {
        (0..1_000_000)
            .map(|i| {
                let normal = DVec2::from_angle(TAU * f64::from(i) / 1_000_000.0);
                let hit = DVec2::new(1.9, 0.6) + 0.3 * normal;
                let lit = normal.dot(p - hit) > 0.0 && normal.dot(q - hit) > 0.0;
                if lit { p.distance(hit) + hit.distance(q) } else { f64::INFINITY }
            })
            .fold(f64::INFINITY, f64::min)
    };
    let (wall, round) = (Reflector::Wall(0), Reflector::Cylinder(0));
    for (walls, bent, expected) in [
        (vec![wall], false, T.distance(below)),
        (vec![round], false, by_round(T, R)),
        (vec![round, wall], false, by_round(T, below)),
        (vec![], true, T.distance(edge) + R.distance(edge)),
        (vec![wall], true, T.distance(edge) + below.distance(edge)),
        (vec![round], true, by_round(T, edge) + R.distance(edge)),
    ] {
        let found: Vec<_> = echoes
            .iter()
            .filter(|echo| {
                reflectors(&echo.path)[..] == walls[..]
                    && diffractors(&echo.path).is_empty() != bent
            })
            .filter(|echo| (echo.length_m - expected).abs() < 1e-9)
            .collect();
        assert_eq!(found.len(), 1, "{walls:?} {expected}: {echoes:#?}");
    }
    // The direct path from one to the other is no echo.
    assert!(echoes.iter().all(|echo| echo.length_m > T.distance(R) + 1e-6));
}

#[test]
fn paths_are_reciprocal() {
    let settings = PathSettings {
        max_path_m: 6.0,
        edge_law: Some(EdgeLaw::Utd),
        floor: 1e-4,
        ..to_the_floor()
    };
    let paths = Paths::new(&plan(), settings);
    let (there, back) = (
        paths.enumerate_between(T, R).expect("few paths"),
        paths.enumerate_between(R, T).expect("few paths"),
    );
    assert!(there.len() >= 15, "{}", there.len());
    for echo in there.iter().filter(|echo| echo.amplitude > 2e-3) {
        let mut walls = reflectors(&echo.path);
        walls.reverse();
        let found = back.iter().any(|other| {
            reflectors(&other.path) == walls
                && diffractors(&other.path) == diffractors(&echo.path)
                && (other.length_m - echo.length_m).abs() < 1e-9
                && (other.amplitude - echo.amplitude).abs() < 1e-6 * echo.amplitude
                && crate::geometry::wrap_pi(other.departure_rad - echo.arrival_rad).abs() < 1e-7
        });
        assert!(found, "no reverse of {echo:?}");
    }
}

#[test]
fn coincident_pair() {
    let settings =
        PathSettings { max_path_m: 5.0, edge_law: Some(EdgeLaw::Utd), floor: 1e-3, ..LOSSLESS };
    let paths = Paths::new(&plan(), settings);
    let one = paths.enumerate(T).expect("few paths");
    let two = paths.enumerate_between(T, T + DVec2::new(1e-7, 0.0)).expect("few paths");
    let strong = |echoes: &[EchoPath]| {
        echoes.iter().filter(|echo| echo.amplitude > 0.02).map(|echo| echo.length_m).collect()
    };
    let (one, two): (Vec<f64>, Vec<f64>) = (strong(&one), strong(&two));
    assert_eq!(one.len(), two.len());
    for (a, b) in one.iter().zip(&two) {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
}

/// One wall, and a pair of transducers closer to it than to the point at which its beam was cut.
#[test]
fn wall_in_front_of_a_pair() {
    let wall = scene(&[[-1.0, 0.0, 1.0, 0.0]]);
    let paths = Paths::new(&wall, PathSettings { max_path_m: 8.0, ..LOSSLESS });
    for step in -9..=9 {
        for (off_m, half) in [(0.07, DVec2::new(0.013, 0.0)), (0.03, DVec2::new(0.01, 0.008))] {
            let middle = DVec2::new(0.1 * f64::from(step), -off_m);
            let [transmitter, receiver] = [middle - half, middle + half];
            let lengths = |echoes: Vec<EchoPath>| echoes.iter().map(|e| e.length_m).collect();
            let found: Vec<f64> =
                lengths(paths.enumerate_between(transmitter, receiver).expect("few paths"));
            let expected = transmitter.distance(DVec2::new(receiver.x, -receiver.y));
            assert_eq!(found.len(), 1, "at {middle}: {found:?}");
            assert!((found[0] - expected).abs() < 1e-12, "at {middle}: {found:?} {expected}");
        }
    }
}

/// Straight up to the ceiling and down to the other: half the separation against the height.
#[test]
fn floor_and_ceiling() {
    let mut room = scene(&[[-9.0, 5.0, 9.0, 5.0]]);
    (room.floor_z_m, room.ceiling_z_m) = (Some(0.0), Some(2.5));
    let settings = PathSettings { max_path_m: 6.0, sensor_z_m: Some(0.9), ..LOSSLESS };
    let paths = Paths::new(&room, settings);
    let apart_m = T.distance(R);
    let found = |echoes: Vec<EchoPath>| -> Vec<f64> {
        let upright = echoes.iter().filter(|echo| {
            let surfaces = reflectors(&echo.path);
            surfaces.iter().all(|surface| matches!(surface, Reflector::Floor | Reflector::Ceiling))
        });
        upright.map(|echo| echo.length_m).collect()
    };
    // By the floor, the ceiling, and both in either order.
    let climbs_m = [1.8, 3.2, 5.0, 5.0];
    let between = found(paths.enumerate_between(T, R).expect("few paths"));
    assert_eq!(between.len(), 4, "{between:?}");
    for (length_m, climb_m) in between.iter().zip(climbs_m) {
        assert!((length_m - apart_m.hypot(climb_m)).abs() < 1e-12, "{between:?}");
    }
    let alone = found(paths.enumerate(T).expect("few paths"));
    assert_eq!(alone.len(), climbs_m.len(), "{alone:?}");
    for (length_m, climb_m) in alone.iter().zip(climbs_m) {
        assert!((length_m - climb_m).abs() < 1e-12, "{alone:?}");
    }
}

/// Diffracted paths end at the same length as all others.
#[test]
fn maximum_length_holds() {
    let max_path_m = 3.4;
    let all =
        PathSettings { max_path_m: 8.0, edge_law: Some(EdgeLaw::Utd), floor: 1e-5, ..LOSSLESS };
    let all = Paths::new(&plan(), all).enumerate_between(T, R).expect("few paths");
    let settings =
        PathSettings { max_path_m, edge_law: Some(EdgeLaw::Utd), floor: 1e-5, ..LOSSLESS };
    let short = Paths::new(&plan(), settings).enumerate_between(T, R).expect("few paths");
    let lengths = |echoes: &[EchoPath]| -> Vec<f64> {
        let near = echoes.iter().filter(|echo| echo.length_m <= max_path_m);
        near.map(|echo| echo.length_m).collect()
    };
    assert!(all.len() > short.len() && short.len() > 3, "{} {}", all.len(), short.len());
    assert!(short.iter().any(|echo| !diffractors(&echo.path).is_empty()));
    assert_eq!(short.len(), lengths(&short).len());
    assert_eq!(lengths(&all).len(), short.len());
}
