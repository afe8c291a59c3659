//! Rooms made up at random.

use std::collections::BTreeMap;

use rand::{Rng, RngExt};

use crate::{
    geometry::{DVec2, Pose},
    scene::{Material, Scene, Wall},
};

/// A rectangular room with `boxes` boxes and `partitions` partition walls in it, its walls turned
/// against the axes, and the pose `start` where nothing stands.
pub fn random_room(name: &str, boxes: usize, partitions: usize, rng: &mut impl Rng) -> Scene {
    let size = DVec2::new(rng.random_range(3.5..6.5), rng.random_range(3.0..5.0));
    let turn = DVec2::from_angle(rng.random_range(-0.4..0.4));
    let material = Material { reflectance: rng.random_range(0.9..0.98), roughness: 0.0 };
    let start = DVec2::new(0.7, 0.7);
    let mut outlines = vec![("room".to_owned(), corners(DVec2::ZERO, size, DVec2::X), true)];
    let mut taken = vec![(start, 0.7)];
    for number in 0..boxes {
        let half = DVec2::new(rng.random_range(0.15..0.4), rng.random_range(0.15..0.4));
        let reach = half.length();
        for _ in 0..50 {
            let at = DVec2::new(rng.random_range(0.0..size.x), rng.random_range(0.0..size.y));
            let off_walls = at.min(size - at).min_element() > reach + 0.6;
            let apart = taken.iter().all(|(other, r)| at.distance(*other) > reach + r + 0.6);
            if off_walls && apart {
                let turned = DVec2::from_angle(rng.random_range(0.0..1.5));
                outlines.push((format!("box-{number}"), corners(-half, half, turned), true));
                let last = outlines.len() - 1;
                outlines[last].1.iter_mut().for_each(|corner| *corner += at);
                taken.push((at, reach));
                break;
            }
        }
    }
    for number in 0..partitions {
        let x = size.x * (number as f64 + 1.0 + rng.random_range(-0.1..0.1))
            / (partitions as f64 + 1.0);
        let long = size.y * rng.random_range(0.35..0.6);
        let (a, b) = match number % 2 {
            0 => (DVec2::new(x, 0.0), DVec2::new(x, long)),
            _ => (DVec2::new(x, size.y), DVec2::new(x, size.y - long)),
        };
        let free = |at: &DVec2, r: f64| (at.x - x).abs() > r + 0.2;
        if taken.iter().all(|(at, r)| free(at, *r)) {
            outlines.push((format!("partition-{number}"), vec![a, b], false));
        }
    }
    let walls = outlines.iter().flat_map(|(id, points, closed)| {
        let ends = points.iter().zip(points.iter().cycle().skip(1));
        let sides = points.len() - usize::from(!closed);
        ends.take(sides).enumerate().map(move |(side, (a, b))| Wall {
            id: format!("{id}.{side}").into(),
            a: turn.rotate(*a),
            b: turn.rotate(*b),
            material,
            z_m: None,
        })
    });
    let start = turn.rotate(start);
    Scene {
        name: name.to_owned(),
        source: None,
        approximate: Vec::new(),
        materials: BTreeMap::from([("wall".to_owned(), material)]),
        walls: walls.collect(),
        cylinders: Vec::new(),
        floor_z_m: None,
        ceiling_z_m: None,
        poses: BTreeMap::from([(
            "start".to_owned(),
            Pose { x_m: start.x, y_m: start.y, heading_deg: 0.0 },
        )]),
        robot: None,
        sha256: String::new(),
    }
}

/// Corners of a rectangle whose first side has a direction.
fn corners(low: DVec2, high: DVec2, turn: DVec2) -> Vec<DVec2> {
    [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
        .map(|corner| turn.rotate(corner))
        .to_vec()
}
