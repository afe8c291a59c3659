//! Sampling of room outlines.

use std::f64::consts::TAU;

use rand::{Rng, RngExt as _};
use sonard_model::geometry::DVec2;

use crate::{
    distribution::NumberDistribution,
    spec::{RoomShape, SpecSceneKeys},
};

/// Corners of a room, counter-clockwise.
#[derive(Debug, Clone)]
pub(super) struct RoomOutline {
    pub(super) corners: Vec<DVec2>,
}

impl RoomOutline {
    /// Returns the walls, from corner to corner.
    pub(super) fn walls(&self) -> impl Iterator<Item = [DVec2; 2]> {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|(a, b)| [*a, *b])
    }
}

/// Maximum deviation of a polygon's corners from even spacing and from the ellipse, as a share of
/// each.
const UNEVEN: f64 = 0.3;
const INDENT: f64 = 0.3;

/// Samples the outline of a room; shape `file` has none and is not passed.
pub(super) fn outline(keys: &SpecSceneKeys, rng: &mut impl Rng) -> RoomOutline {
    let draw = |spread: &Option<NumberDistribution>, default: NumberDistribution, rng: &mut _| {
        spread.as_ref().unwrap_or(&default).draw(rng)
    };
    let width_m = draw(&keys.width_m, NumberDistribution::Fixed(4.0), rng);
    let depth_m = draw(&keys.depth_m, NumberDistribution::Fixed(4.0), rng);
    let mut notch = || draw(&keys.notch, NumberDistribution::Uniform([0.3, 0.6]), rng);
    let corners = match keys.shape {
        RoomShape::Rectangle | RoomShape::File => {
            vec![[0.0, 0.0], [width_m, 0.0], [width_m, depth_m], [0.0, depth_m]]
        }
        RoomShape::L => {
            let (x, y) = (width_m * (1.0 - notch()), depth_m * (1.0 - notch()));
            vec![[0.0, 0.0], [width_m, 0.0], [width_m, y], [x, y], [x, depth_m], [0.0, depth_m]]
        }
        RoomShape::T => {
            let (x, y) = (0.5 * width_m * notch(), depth_m * notch());
            vec![
                [x, 0.0],
                [width_m - x, 0.0],
                [width_m - x, y],
                [width_m, y],
                [width_m, depth_m],
                [0.0, depth_m],
                [0.0, y],
                [x, y],
            ]
        }
        RoomShape::Polygon => {
            let default = NumberDistribution::Uniform([5.0, 8.0]);
            let count = keys.corners.as_ref().unwrap_or(&default).count(rng);
            polygon(count, DVec2::new(width_m, depth_m), rng)
        }
    };
    let turn_deg = draw(&keys.turn_deg, NumberDistribution::Fixed(0.0), rng);
    let turn = DVec2::from_angle(turn_deg.to_radians());
    // Rooms without rotation avoid rounding errors.
    let turned = |corner: [f64; 2]| match turn_deg == 0.0 {
        true => corner.into(),
        false => turn.rotate(corner.into()),
    };
    RoomOutline { corners: corners.into_iter().map(turned).collect() }
}

/// Samples a polygon within an ellipse of this size, star-shaped about its center.
fn polygon(count: usize, size: DVec2, rng: &mut impl Rng) -> Vec<[f64; 2]> {
    let first = rng.random_range(0.0..TAU);
    let corner = |number: usize| {
        let off = rng.random_range(-0.5 * UNEVEN..0.5 * UNEVEN);
        let angle = first + TAU * (number as f64 + off) / count as f64;
        let share = 0.5 * rng.random_range(1.0 - INDENT..1.0);
        (0.5 * size + share * size * DVec2::from_angle(angle)).into()
    };
    (0..count).map(corner).collect()
}
