//! Rays to an upright edge, in the edge's coordinates.

use crate::model::paths::{
    beams::UnfoldedRay,
    cylinders::SpreadRay,
    echo::drop_repeats,
    floor::{ALL_SLOPES, PlanCorner},
    rays::Rays,
    settings::PathSettings,
    tolerance::{SAME_M, SAME_RAD},
};

/// A ray to an edge.
#[derive(Clone, Copy)]
pub(crate) struct EdgeRay<'a> {
    pub(crate) ray: &'a UnfoldedRay,
    /// Number as in [`Rays::to_edge`].
    pub(crate) number: u32,
    pub(crate) length_m: f64,
    /// Width of the ray tube at the edge, metres; the ray's length without cylinders.
    pub(crate) width_m: f64,
    /// Radius of curvature of the wave front at the edge, metres; the ray's length without
    /// cylinders.
    pub(crate) radius_m: f64,
    /// `true` for a ray by way of a cylinder.
    pub(crate) is_spread: bool,
    /// Sector of air between the edge's walls in which the ray arrives.
    pub(crate) sector: usize,
    /// Direction from the edge towards the source, from the sector's first wall, radians.
    pub(crate) from_rad: f64,
    /// Possible slopes; see [`UnfoldedRay::slopes`].
    pub(crate) slopes: u32,
}

impl<'a> EdgeRay<'a> {
    /// Returns `None` for a ray along a wall, and in a sector that diffracts nothing back.
    fn new(
        corner: &PlanCorner,
        ray: &'a UnfoldedRay,
        number: u32,
        spread: Option<&SpreadRay>,
    ) -> Option<Self> {
        let (sector, from_rad) = corner.sector(-ray.run)?;
        let length_m = ray.run.length();
        let slopes = ray.slopes;
        let [width_m, radius_m] =
            spread.map_or([length_m; 2], |spread| [spread.width_m, spread.radius_m]);
        let is_spread = spread.is_some();
        Some(Self { ray, number, length_m, width_m, radius_m, is_spread, sector, from_rad, slopes })
    }

    /// Creates an edge ray over walls alone.
    pub(crate) fn by_walls(corner: &PlanCorner, ray: &'a UnfoldedRay, number: u32) -> Option<Self> {
        Self::new(corner, ray, number, None)
    }

    /// Returns the rays to an edge, by length, without repeats.
    pub(crate) fn all(corner: &PlanCorner, rays: &'a Rays, point: u32) -> Vec<Self> {
        let (first, by_walls) = rays.beams.rays_to_edge(point);
        let (first_spread, spread) = rays.spread_to_edge(point);
        let by_walls = (first..)
            .zip(by_walls)
            .filter_map(|(number, (_, ray))| Self::by_walls(corner, ray, number));
        let spread = (first_spread..)
            .zip(spread)
            .filter_map(|(number, spread)| Self::new(corner, &spread.ray, number, Some(spread)));
        let mut all: Vec<Self> = by_walls.chain(spread).collect();
        all.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
        free_repeats(&mut all);
        drop_repeats(&mut all, |ray| ray.length_m, Self::is_same);
        all
    }

    /// Returns `true` for the two copies of a ray that touches a corner and was found on both sides
    /// of it.
    fn is_same(&self, other: &Self) -> bool {
        is_same_departure(self.ray, other.ray)
    }
}

/// Removes the slope limits of a ray that was found on both sides of a corner with different
/// slopes. The rays must be sorted by length.
fn free_repeats(rays: &mut [EdgeRay]) {
    for at in 1..rays.len() {
        let ray = rays[at];
        for before in (0..at).rev() {
            if ray.length_m - rays[before].length_m >= SAME_M {
                break;
            }
            if rays[before].is_same(&ray) && rays[before].slopes != ray.slopes {
                (rays[before].slopes, rays[at].slopes) = (ALL_SLOPES, ALL_SLOPES);
            }
        }
    }
}

/// Kouyoumjian and Pathak's distance parameter, metres, of a front of radius `a_m` that continues
/// from an edge for `b_m`.
pub(crate) fn distance_parameter_m(one_m: f64, other_m: f64) -> f64 {
    one_m * other_m / (one_m + other_m)
}

/// Returns `true` if two rays of equal length from one start leave in the same direction.
pub(crate) fn is_same_departure(a: &UnfoldedRay, b: &UnfoldedRay) -> bool {
    a.departure.distance_squared(b.departure) < SAME_RAD * SAME_RAD
}

/// Amplitude floor of echoes of a length, out on one ray to an edge and back on one to the same or
/// another edge.
pub(crate) fn floor(settings: &PathSettings, out: &EdgeRay, back: &EdgeRay, length_m: f64) -> f64 {
    settings.contact_floor(out.is_spread || back.is_spread, length_m)
}
