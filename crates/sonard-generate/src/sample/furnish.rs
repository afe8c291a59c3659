//! Sampling of boxes, cylinders and partitions without collisions.

use rand::{Rng, RngExt as _};
use sonard_model::geometry::{DVec2, distance_to_segment, encloses};

use super::{RejectedDraws, Rejection, room::RoomOutline};
use crate::spec::FurnitureKeys;

/// Piece of furniture in plan view.
#[derive(Debug, Clone)]
pub(super) enum Furniture {
    /// Corners of a closed box.
    Box([DVec2; 4]),
    Cylinder {
        center: DVec2,
        radius_m: f64,
    },
    /// Wall that extends from another one.
    Partition([DVec2; 2]),
}

/// Maximum number of positions drawn per piece before the scene is rejected.
const MAX_POSITIONS: usize = 100;
/// Spacing of the points of a partition that are checked for collisions, metres.
const STEP_M: f64 = 0.05;

/// Samples all pieces of furniture.
///
/// # Errors
/// Returns an error if a piece has no free position.
pub(super) fn furnish(
    outline: &RoomOutline,
    keys: &FurnitureKeys,
    rng: &mut impl Rng,
    redrawn: &mut RejectedDraws,
) -> Result<Vec<Furniture>, Rejection> {
    let mut room =
        FurnishedRoom { outline, walls: outline.walls().collect(), occupied: Vec::new() };
    let counts = [&keys.partitions, &keys.boxes, &keys.cylinders].map(|spread| spread.count(rng));
    let mut pieces = Vec::new();
    for (kind, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let placed = (0..MAX_POSITIONS).find_map(|_| {
                let placed = match kind {
                    0 => room.partition(keys, rng),
                    1 => room.place_box(keys, rng),
                    _ => room.cylinder(keys, rng),
                };
                redrawn.furniture += u64::from(placed.is_none());
                placed
            });
            pieces.push(placed.ok_or(Rejection::Furniture)?);
        }
    }
    Ok(pieces)
}

struct FurnishedRoom<'a> {
    outline: &'a RoomOutline,
    /// Walls of the room, and partitions.
    walls: Vec<[DVec2; 2]>,
    /// Bounding circles of placed pieces.
    occupied: Vec<(DVec2, f64)>,
}

impl FurnishedRoom<'_> {
    /// Draws a position with a free radius, metres; `None` if it is occupied.
    fn place(&self, reach_m: f64, rng: &mut impl Rng) -> Option<DVec2> {
        let corners = &self.outline.corners;
        let low = corners.iter().copied().reduce(DVec2::min)?;
        let high = corners.iter().copied().reduce(DVec2::max)?;
        let at = low + DVec2::new(rng.random(), rng.random()) * (high - low);
        let off_walls = self.walls.iter().all(|[a, b]| distance_to_segment(at, *a, *b) >= reach_m);
        let apart = self.occupied.iter().all(|(other, r)| at.distance(*other) >= reach_m + r);
        (off_walls && apart && encloses(corners, at)).then_some(at)
    }

    fn place_box(&mut self, keys: &FurnitureKeys, rng: &mut impl Rng) -> Option<Furniture> {
        let half = 0.5 * DVec2::new(keys.box_m.draw(rng), keys.box_m.draw(rng));
        let turn = DVec2::from_angle(keys.box_turn_deg.draw(rng).to_radians());
        let at = self.place(half.length() + keys.gap_m, rng)?;
        self.occupied.push((at, half.length()));
        let corner = |x: f64, y: f64| at + turn.rotate(half * DVec2::new(x, y));
        Some(Furniture::Box([
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ]))
    }

    fn cylinder(&mut self, keys: &FurnitureKeys, rng: &mut impl Rng) -> Option<Furniture> {
        let radius_m = keys.radius_m.draw(rng);
        let center = self.place(radius_m + keys.gap_m, rng)?;
        self.occupied.push((center, radius_m));
        Some(Furniture::Cylinder { center, radius_m })
    }

    /// Draws a partition perpendicular to a wall of the room; `None` if it collides.
    fn partition(&mut self, keys: &FurnitureKeys, rng: &mut impl Rng) -> Option<Furniture> {
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
        Some(Furniture::Partition([foot, end]))
    }
}
