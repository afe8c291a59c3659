//! Low, hanging and high walls in combination: beams end where none of their rays is at the right
//! height.

use super::*;
use crate::scene::Cylinder;

/// A room with boxes, shelves and posts of any heights.
fn furnished(random: &mut Pcg64) -> Scene {
    let mut walls = vec![
        [0.0, 0.0, 2.2, 0.0],
        [2.2, 0.0, 2.2, 1.7],
        [2.2, 1.7, 0.0, 1.7],
        [0.0, 1.7, 0.0, 0.0],
    ];
    for _ in 0..random.random_range(1..4) {
        let at = DVec2::new(random.random_range(0.3..1.9), random.random_range(0.3..1.4));
        let half = DVec2::new(random.random_range(0.05..0.3), random.random_range(0.05..0.3));
        let turn = DVec2::from_angle(random.random_range(0.0..TAU));
        let corner = |x: f64, y: f64| at + turn.rotate(half * DVec2::new(x, y));
        let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let ends = corners.iter().zip(corners.iter().cycle().skip(1));
        walls.extend(ends.map(|(a, b)| [a.x, a.y, b.x, b.y]));
    }
    let mut room = scene(&walls);
    (room.floor_z_m, room.ceiling_z_m) = match random.random_range(0..4) {
        0 => (Some(0.0), None),
        1 => (None, Some(1.3)),
        _ => (Some(0.0), Some(1.3)),
    };
    room.ceiling_material.reflectance = random.random_range(0.5..1.0);
    let mut heights = |least: f64| {
        let at = random.random_range(least..1.1);
        [[0.0, at], [at, 1.3], [0.5 * at, at], [0.0, 1.3]][random.random_range(0..4)]
    };
    for piece in room.walls[4..].chunks_mut(4) {
        let heights = heights(0.1);
        piece.iter_mut().for_each(|wall| wall.z_m = Some(heights));
    }
    if random.random_bool(0.3) {
        let heights = random.random_bool(0.7).then_some([0.0, 0.7]);
        room.cylinders.push(Cylinder {
            id: "leg".into(),
            center: DVec2::new(random.random_range(0.2..2.0), random.random_range(0.2..1.5)),
            radius_m: 0.03,
            material: Material::RIGID,
            z_m: heights,
        });
    }
    for wall in &mut room.walls {
        wall.material.reflectance = random.random_range(0.6..1.0);
        wall.material.roughness = if random.random_bool(0.2) { 0.3 } else { 0.0 };
    }
    room
}

/// Length, strength and directions, in an order that rounding does not change.
fn summary(echoes: &[EchoPath]) -> Vec<[f64; 6]> {
    let row = |echo: &EchoPath| {
        let [leaves_rad, comes_rad] = echo.rise_rad;
        [echo.length_m, echo.amplitude, echo.departure_rad, echo.arrival_rad, leaves_rad, comes_rad]
    };
    let mut summary: Vec<_> = echoes.iter().map(row).collect();
    let rounded = |echo: &[f64; 6]| echo.map(|value| (value * 1e7).round() as i64);
    summary.sort_by_key(rounded);
    summary
}

#[test]
fn height_cuts_lose_no_echo() {
    let mut random = Pcg64::seed_from_u64(7);
    let [mut echoes, mut cut, mut uncut] = [0; 3];
    for case in 0..60 {
        let room = furnished(&mut random);
        let mut place = || DVec2::new(random.random_range(0.1..2.1), random.random_range(0.1..1.6));
        let from = place();
        let to = if case % 3 == 0 { place() } else { from };
        let settings = PathSettings {
            max_path_m: 5.0,
            // Without the ends, beams between low walls double at each.
            max_order: Some(4),
            floor: 0.01,
            absorption_np_per_m: 0.05,
            edge_law: Some(EdgeLaw::Utd),
            sensor_z_m: Some([0.3, 0.55, 0.9][case % 3]),
            scatter_height_rad: 0.2,
            ..LOSSLESS
        };
        let paths = Paths::new(&room, settings);
        let all = paths.clone().without_cuts();
        let [found, expected] = [&paths, &all]
            .map(|paths| summary(&paths.enumerate_between(from, to).expect("few paths")));
        assert_eq!(found.len(), expected.len(), "case {case}: {from} {to} {room:?}");
        for (one, other) in found.iter().zip(&expected) {
            let is_same = one.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(is_same, "case {case}: {one:?} {other:?}");
        }
        echoes += found.len();
        cut += paths.beams_from(from);
        uncut += all.beams_from(from);
    }
    assert!(echoes > 10_000 && 2 * cut < uncut, "{echoes} {cut} {uncut}");
}
