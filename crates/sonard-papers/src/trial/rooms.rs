//! Random rooms for simulated experiments.

use std::collections::BTreeMap;

use rand::{Rng, RngExt};

use sonard_model::{
    geometry::{DVec2, Pose},
    scene::{DEFAULT_SNAP_M, Material, Scene, Wall},
};

/// Rectangular room with up to `boxes` boxes and `partitions` partition walls, rotated against the
/// axes, and the pose `start` in free space.
pub fn random_room(name: &str, boxes: usize, partitions: usize, rng: &mut impl Rng) -> Scene {
    let size = DVec2::new(rng.random_range(3.5..6.5), rng.random_range(3.0..5.0));
    let turn = DVec2::from_angle(rng.random_range(-0.4..0.4));
    let material = Material::smooth(rng.random_range(0.9..0.98));
    let start = DVec2::new(0.7, 0.7);
    let mut room = RoomBuilder::new(size, start);
    room.add_boxes(boxes, [0.15, 0.4], 0.6, rng);
    for number in 0..partitions {
        let x = size.x * (number as f64 + 1.0 + rng.random_range(-0.1..0.1))
            / (partitions as f64 + 1.0);
        let long = size.y * rng.random_range(0.35..0.6);
        let (a, b) = match number % 2 {
            0 => (DVec2::new(x, 0.0), DVec2::new(x, long)),
            _ => (DVec2::new(x, size.y), DVec2::new(x, size.y - long)),
        };
        let free = |at: &DVec2, r: f64| (at.x - x).abs() > r + 0.2;
        if room.occupied.iter().all(|(at, r)| free(at, *r)) {
            room.outlines.push((format!("partition-{number}"), vec![a, b], false));
        }
    }
    room.scene(name, turn, material)
}

/// Gallery-like room with two or three objects that a robot can round at about a metre, and the
/// pose `start` near a corner.
pub fn gallery(name: &str, rng: &mut impl Rng) -> Scene {
    let size = DVec2::new(rng.random_range(6.0..8.0), rng.random_range(5.0..6.5));
    let turn = DVec2::from_angle(rng.random_range(-0.4..0.4));
    let material = Material::smooth(rng.random_range(0.9..0.98));
    let mut room = RoomBuilder::new(size, DVec2::new(1.1, 1.0));
    let boxes = rng.random_range(2..=3);
    room.add_boxes(boxes, [0.25, 0.6], 1.1, rng);
    room.scene(name, turn, material)
}

/// Room under construction with its first corner at the origin.
struct RoomBuilder {
    size: DVec2,
    start: DVec2,
    /// Name, corners and closure of each outline.
    outlines: Vec<(String, Vec<DVec2>, bool)>,
    /// Centre and radius of each occupied circle.
    occupied: Vec<(DVec2, f64)>,
}

impl RoomBuilder {
    fn new(size: DVec2, start: DVec2) -> Self {
        let outlines = vec![("room".to_owned(), corners(DVec2::ZERO, size, DVec2::X), true)];
        Self { size, start, outlines, occupied: vec![(start, 0.7)] }
    }

    /// Adds boxes with half sides in a range and a gap around them, metres, as space permits.
    fn add_boxes(&mut self, count: usize, half_m: [f64; 2], gap_m: f64, rng: &mut impl Rng) {
        let [min, max] = half_m;
        for number in 0..count {
            let half = DVec2::new(rng.random_range(min..max), rng.random_range(min..max));
            let reach = half.length();
            for _ in 0..50 {
                let Self { size, occupied, .. } = &self;
                let at = DVec2::new(rng.random_range(0.0..size.x), rng.random_range(0.0..size.y));
                let clears_walls = at.min(*size - at).min_element() > reach + gap_m;
                let is_clear =
                    occupied.iter().all(|(other, r)| at.distance(*other) > reach + r + gap_m);
                if clears_walls && is_clear {
                    let direction = DVec2::from_angle(rng.random_range(0.0..1.5));
                    let around = corners(-half, half, direction).iter().map(|c| *c + at).collect();
                    self.outlines.push((format!("box-{number}"), around, true));
                    self.occupied.push((at, reach));
                    break;
                }
            }
        }
    }

    /// Scene of the room, rotated about the origin.
    fn scene(&self, name: &str, turn: DVec2, material: Material) -> Scene {
        let walls = self.outlines.iter().flat_map(|(id, points, closed)| {
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
        let start = turn.rotate(self.start);
        Scene {
            name: name.to_owned(),
            source: None,
            approximate: Vec::new(),
            materials: BTreeMap::from([("wall".to_owned(), material)]),
            walls: walls.collect(),
            cylinders: Vec::new(),
            floor_z_m: None,
            ceiling_z_m: None,
            floor_material: Material::RIGID,
            ceiling_material: Material::RIGID,
            snap_m: DEFAULT_SNAP_M,
            poses: BTreeMap::from([(
                "start".to_owned(),
                Pose { x_m: start.x, y_m: start.y, heading_deg: 0.0 },
            )]),
            robot: None,
            sha256: String::new(),
            text: "".into(),
        }
    }
}

/// Corners of a rectangle, rotated to a direction of the first side.
fn corners(low: DVec2, high: DVec2, turn: DVec2) -> Vec<DVec2> {
    [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
        .map(|corner| turn.rotate(corner))
        .to_vec()
}
