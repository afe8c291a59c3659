//! Poses that are indistinguishable by any sweep.

use sonard_inverse::World;
use sonard_model::geometry::{DVec2, Pose, wrap_180};

/// Pose and, in a scene with point symmetry, its equally correct counterpart.
pub(crate) fn equivalent_poses(truth: &World, pose: &Pose) -> Vec<Pose> {
    let ends = || truth.scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let low = ends().fold(DVec2::INFINITY, DVec2::min);
    let high = ends().fold(DVec2::NEG_INFINITY, DVec2::max);
    let [x_m, y_m] = (low + high - pose.position()).to_array();
    let turned = Pose { x_m, y_m, heading_deg: wrap_180(pose.heading_deg + 180.0) };
    let read = |pose: &Pose| -> Option<Vec<Option<f64>>> {
        let simulator = truth.simulator(pose).ok()?;
        let point = simulator.at(pose.position());
        let of = |at: u32| {
            Some(point.ping(truth.direction_rad(pose, f64::from(at) * 7.5)).ok()?.range_m)
        };
        (0..48).map(of).collect()
    };
    let is_same = |one: &Option<f64>, other: &Option<f64>| match (one, other) {
        (Some(one), Some(other)) => (one - other).abs() < 1e-3,
        (one, other) => one == other,
    };
    let is_image = match (read(pose), read(&turned)) {
        (Some(here), Some(there)) => {
            here.iter().zip(&there).filter(|(one, other)| is_same(one, other)).count() >= 46
        }
        _ => false,
    };
    [*pose].into_iter().chain(is_image.then_some(turned)).collect()
}
