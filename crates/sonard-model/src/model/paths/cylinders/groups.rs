//! Half-paths grouped for connecting.

use super::{departures::Departures, half_path::HalfPath, strength::Strength};
use crate::geometry::wrap_pi;

/// Half-paths by level and cylinder: `level * cylinders + cylinder`.
pub(crate) struct HalfPathGroups {
    pub(crate) by_cylinder: Vec<Vec<HalfPathGroup>>,
    pub(crate) cylinders: usize,
}

/// Half-paths that leave in similar directions, by decreasing [`Strength::x`].
pub(crate) struct HalfPathGroup {
    pub(crate) half_paths: Vec<u32>,
    pub(crate) departures: Departures,
    /// Maximum of `x` and of `y`.
    pub(crate) max_strength: Strength,
    /// Length of the shortest half-path, metres.
    pub(crate) min_m: f64,
}

/// Width of a group in directions of departure, radians.
const GROUP_RAD: f64 = 0.1;

impl HalfPathGroups {
    pub(crate) fn new(all: &[HalfPath], cylinders: usize) -> Self {
        let mut by_cylinder: Vec<Vec<HalfPathGroup>> = Vec::new();
        let key = |half_path: &HalfPath| {
            let cylinder = half_path.level as usize * cylinders + half_path.cylinder as usize;
            (cylinder, (half_path.departures.middle_rad / GROUP_RAD).floor() as i64)
        };
        let keyed =
            |(half_path, index): (&HalfPath, u32)| (key(half_path), half_path.strength.x, index);
        let mut order: Vec<((usize, i64), f64, u32)> = all.iter().zip(0..).map(keyed).collect();
        order.sort_unstable_by(|a, b| {
            let by_x = b.1.total_cmp(&a.1);
            a.0.cmp(&b.0).then(by_x).then(a.2.cmp(&b.2))
        });
        for group in order.chunk_by(|a, b| a.0 == b.0) {
            let (cylinder, _) = group[0].0;
            if by_cylinder.len() <= cylinder {
                by_cylinder.resize_with(cylinder + 1, Vec::new);
            }
            let half_paths: Vec<u32> = group.iter().map(|keyed| keyed.2).collect();
            by_cylinder[cylinder].push(HalfPathGroup::new(half_paths, all));
        }
        Self { by_cylinder, cylinders }
    }
}

impl HalfPathGroup {
    fn new(half_paths: Vec<u32>, all: &[HalfPath]) -> Self {
        let first = all[half_paths[0] as usize].departures;
        let each = || half_paths.iter().map(|&index| &all[index as usize]);
        let reach = |half_path: &HalfPath| {
            wrap_pi(half_path.departures.middle_rad - first.middle_rad).abs()
                + half_path.departures.half_rad
        };
        let half_rad = each().map(reach).fold(0.0, f64::max);
        let max_strength =
            each().map(|half_path| half_path.strength).fold(Strength::default(), Strength::max);
        let min_m = each().map(|half_path| half_path.min_m).fold(f64::INFINITY, f64::min);
        Self { departures: Departures { half_rad, ..first }, max_strength, min_m, half_paths }
    }
}
