//! Walls above one another, as around a window.

use super::*;
use crate::model::Reflector;

/// A room with floor and ceiling, and across it walls on one line between these heights. From the
/// ranger they are 1.5 m away.
fn room_with(heights_m: &[[f64; 2]]) -> Scene {
    let across = vec![[2.5, 0.2, 2.5, 2.0]; heights_m.len()];
    let outer =
        [[0.0, 0.0, 4.0, 0.0], [4.0, 0.0, 4.0, 3.0], [4.0, 3.0, 0.0, 3.0], [0.0, 3.0, 0.0, 0.0]];
    let mut room = scene(&[across.as_slice(), &outer].concat());
    (room.floor_z_m, room.ceiling_z_m) = (Some(0.0), Some(2.5));
    for (wall, &limits) in room.walls.iter_mut().zip(heights_m) {
        wall.z_m = Some(limits);
    }
    room
}

const SILL: [f64; 2] = [0.0, 0.7];
const LINTEL: [f64; 2] = [1.5, 2.5];

const AT: DVec2 = DVec2::new(1.0, 1.2);

fn echoes(room: &Scene, z_m: f64, edge_law: Option<EdgeLaw>) -> Vec<EchoPath> {
    let settings = PathSettings {
        sensor_z_m: Some(z_m),
        max_path_m: 8.0,
        max_order: Some(3),
        floor: 1e-4,
        edge_law,
        ..LOSSLESS
    };
    Paths::new(room, settings).enumerate(AT).expect("few paths")
}

#[test]
fn each_at_its_own_height() {
    let room = room_with(&[SILL, LINTEL]);
    for (z_m, first, length_m) in [(0.5, 0, 3.0), (1.1, 3, 6.0), (2.0, 1, 3.0)] {
        let ahead: Vec<_> = echoes(&room, z_m, None)
            .into_iter()
            .filter(|echo| reflectors(&echo.path)[..] == [Reflector::Wall(first)])
            .collect();
        assert_eq!(ahead.len(), 1, "{z_m}: {ahead:?}");
        assert!((ahead[0].length_m - length_m).abs() < 1e-9, "{z_m}: {ahead:?}");
    }
}

#[test]
fn order_does_not_matter() {
    let [one, other] = [[SILL, LINTEL], [LINTEL, SILL]].map(|heights| room_with(&heights));
    for z_m in [0.5, 1.1, 2.0] {
        let laws = [None, Some(EdgeLaw::Utd)];
        let sorted = |room: &Scene, law| {
            let mut all: Vec<[f64; 2]> = echoes(room, z_m, law)
                .iter()
                .filter(|echo| {
                    !diffractors(&echo.path)
                        .iter()
                        .any(|diffractor| matches!(diffractor, Diffractor::Upright(_)))
                })
                .map(|echo| [echo.length_m, echo.amplitude])
                .collect();
            all.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
            all
        };
        for law in laws {
            let (one, other) = (sorted(&one, law), sorted(&other, law));
            assert_eq!(one.len(), other.len(), "{z_m}");
            for (a, b) in one.iter().zip(&other) {
                assert!(
                    (a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9,
                    "{z_m}: {a:?} {b:?}"
                );
            }
        }
    }
}

#[test]
fn adjoining_walls_are_one() {
    let [whole, halves] = [vec![[0.0, 2.5]], vec![[0.0, 1.0], [1.0, 2.5]]]
        .map(|heights| echoes(&room_with(&heights), 1.1, None));
    let lengths = |echoes: &[EchoPath]| echoes.iter().map(|echo| echo.length_m).collect::<Vec<_>>();
    let (whole, halves) = (lengths(&whole), lengths(&halves));
    assert_eq!(whole.len(), halves.len());
    for (a, b) in whole.iter().zip(&halves) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}
