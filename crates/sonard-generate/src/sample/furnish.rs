//! Boxes, cylinders and partitions in a room, none in another's way.

use rand::{Rng, RngExt as _};
use sonard_model::geometry::{DVec2, distance_to_segment, encloses};

use super::{Redrawn, Unfit, room::Outline};
use crate::spec::FurnitureKeys;

/// A piece of furniture.
#[derive(Debug, Clone)]
pub(super) enum Piece {
    /// A closed outline.
    Box([DVec2; 4]),
    Cylinder {
        center: DVec2,
        radius_m: f64,
    },
    /// A wall that stands out from another.
    Partition([DVec2; 2]),
}

/// Places that are tried for a piece before the scene is drawn again.
const PLACES: usize = 100;
/// Points of a partition that are looked at are so far apart, metres.
const STEP_M: f64 = 0.05;

/// Draws all pieces.
///
/// # Errors
/// When one finds no place.
pub(super) fn furnish(
    outline: &Outline,
    keys: &FurnitureKeys,
    rng: &mut impl Rng,
    redrawn: &mut Redrawn,
) -> Result<Vec<Piece>, Unfit> {
    let mut room = Room { outline, walls: outline.walls().collect(), taken: Vec::new() };
    let counts = [&keys.partitions, &keys.boxes, &keys.cylinders].map(|spread| spread.count(rng));
    let mut pieces = Vec::new();
    for (kind, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let placed = (0..PLACES).find_map(|_| {
                let placed = match kind {
                    0 => room.partition(keys, rng),
                    1 => room.put_box(keys, rng),
                    _ => room.cylinder(keys, rng),
                };
                redrawn.furniture += u64::from(placed.is_none());
                placed
            });
            pieces.push(placed.ok_or(Unfit::Furniture)?);
        }
    }
    Ok(pieces)
}

struct Room<'a> {
    outline: &'a Outline,
    /// The room's, and partitions.
    walls: Vec<[DVec2; 2]>,
    /// Circles that something stands in.
    taken: Vec<(DVec2, f64)>,
}

impl Room<'_> {
    /// A place in the room with so much around it free, metres.
    fn place(&self, reach_m: f64, rng: &mut impl Rng) -> Option<DVec2> {
        let corners = &self.outline.corners;
        let low = corners.iter().copied().reduce(DVec2::min)?;
        let high = corners.iter().copied().reduce(DVec2::max)?;
        let at = low + DVec2::new(rng.random(), rng.random()) * (high - low);
        let off_walls = self.walls.iter().all(|[a, b]| distance_to_segment(at, *a, *b) >= reach_m);
        let apart = self.taken.iter().all(|(other, r)| at.distance(*other) >= reach_m + r);
        (off_walls && apart && encloses(corners, at)).then_some(at)
    }

    fn put_box(&mut self, keys: &FurnitureKeys, rng: &mut impl Rng) -> Option<Piece> {
        let half = 0.5 * DVec2::new(keys.box_m.draw(rng), keys.box_m.draw(rng));
        let turn = DVec2::from_angle(keys.box_turn_deg.draw(rng).to_radians());
        let at = self.place(half.length() + keys.gap_m, rng)?;
        self.taken.push((at, half.length()));
        let corner = |x: f64, y: f64| at + turn.rotate(half * DVec2::new(x, y));
        Some(Piece::Box([
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ]))
    }

    fn cylinder(&mut self, keys: &FurnitureKeys, rng: &mut impl Rng) -> Option<Piece> {
        let radius_m = keys.radius_m.draw(rng);
        let center = self.place(radius_m + keys.gap_m, rng)?;
        self.taken.push((center, radius_m));
        Some(Piece::Cylinder { center, radius_m })
    }

    /// A wall at right angles to one of the room's, into the room.
    fn partition(&mut self, keys: &FurnitureKeys, rng: &mut impl Rng) -> Option<Piece> {
        let long_m = keys.partition_m.draw(rng);
        let behind = rng.random_range(0..self.outline.corners.len());
        let [a, b] = self.walls[behind];
        let foot = a + rng.random_range(0.2..0.8) * (b - a);
        let inward = (b - a).normalize_or_zero().perp();
        let steps = (long_m / STEP_M).ceil().max(1.0);
        let is_free = |step: usize| {
            let out_m = long_m * step as f64 / steps;
            let at = foot + out_m * inward;
            let off = |(index, [a, b]): (usize, &[DVec2; 2])| {
                index == behind || distance_to_segment(at, *a, *b) >= keys.gap_m
            };
            encloses(&self.outline.corners, at) && self.walls.iter().enumerate().all(off)
        };
        let end = foot + long_m * inward;
        if !(1..=steps as usize).all(is_free) {
            return None;
        }
        self.walls.push([foot, end]);
        Some(Piece::Partition([foot, end]))
    }
}
