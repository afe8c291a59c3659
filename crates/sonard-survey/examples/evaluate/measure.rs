//! Comparison of a survey with the true room.

use std::{collections::BTreeSet, sync::Arc};

use sonard_inverse::{FitSweep, World, WorldError};
use sonard_model::{
    geometry::{DVec2, Pose, distance_to_segment, wrap_180},
    model::{Reflector, TooCostly},
    reading::PingStatus,
    scene::Scene,
};
use sonard_survey::PostShape;

/// Wall as a pair of ends, metres.
pub(crate) type Ends = [DVec2; 2];

/// Rigid motion from the frame of a survey to the true one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RigidMotion {
    turn: DVec2,
    by: DVec2,
}

impl RigidMotion {
    /// Motion that lays places on the true ones (least squares).
    pub(crate) fn between(found: &[Pose], truth: &[Pose]) -> Self {
        let mean = |poses: &[Pose]| {
            poses.iter().map(Pose::position).sum::<DVec2>() / poses.len().max(1) as f64
        };
        let (from, to) = (mean(found), mean(truth));
        let (mut cosine, mut sine) = (0.0, 0.0);
        for (a, b) in found.iter().zip(truth) {
            let (a, b) = (a.position() - from, b.position() - to);
            cosine += a.dot(b);
            sine += a.perp_dot(b);
        }
        let turn = DVec2::new(cosine, sine).normalize_or(DVec2::X);
        Self { turn, by: to - turn.rotate(from) }
    }

    pub(crate) fn of(&self, point: DVec2) -> DVec2 {
        self.turn.rotate(point) + self.by
    }

    pub(crate) fn inverse_of(&self, pose: &Pose) -> Pose {
        let back = DVec2::new(self.turn.x, -self.turn.y);
        let at = back.rotate(pose.position() - self.by);
        let heading_deg = pose.heading_deg - self.turn.to_angle().to_degrees();
        Pose { x_m: at.x, y_m: at.y, heading_deg }
    }

    /// Mean errors of positions, metres, and headings, degrees.
    pub(crate) fn pose_errors(&self, found: &[Pose], truth: &[Pose]) -> [f64; 2] {
        let turn_deg = self.turn.to_angle().to_degrees();
        let (mut off_m, mut off_deg) = (0.0, 0.0);
        for (a, b) in found.iter().zip(truth) {
            off_m += self.of(a.position()).distance(b.position());
            off_deg += wrap_180(a.heading_deg + turn_deg - b.heading_deg).abs();
        }
        let count = found.len().max(1) as f64;
        [off_m / count, off_deg / count]
    }
}

/// Share of the length of walls that is within a distance, metres, and an angle, degrees, of
/// others.
pub(crate) fn coverage(walls: &[Ends], others: &[Ends], off_m: f64, off_deg: f64) -> f64 {
    const STEP_M: f64 = 0.01;
    let (mut length_m, mut covered_m) = (0.0, 0.0);
    for [a, b] in walls {
        let own_m = a.distance(*b);
        let count = (own_m / STEP_M).ceil().max(2.0);
        let is_parallel = |[c, d]: &&Ends| {
            let sine = (b - a).normalize_or_zero().perp_dot((d - c).normalize_or_zero());
            sine.abs() < off_deg.to_radians().sin()
        };
        let near: Vec<&Ends> = others.iter().filter(is_parallel).collect();
        let is_covered = |at: &usize| {
            let point = a.lerp(*b, (*at as f64 + 0.5) / count);
            near.iter().any(|[c, d]| distance_to_segment(point, *c, *d) < off_m)
        };
        let covered = (0..count as usize).filter(is_covered).count();
        length_m += own_m;
        covered_m += own_m * covered as f64 / count;
    }
    if length_m > 0.0 { covered_m / length_m } else { 0.0 }
}

/// Distances of true corners to the nearest end of a wall, metres.
pub(crate) fn corner_errors_m(truth: &[Ends], walls: &[Ends]) -> Vec<f64> {
    let mut corners: Vec<DVec2> = truth.iter().flatten().copied().collect();
    corners.dedup_by(|a, b| a.distance(*b) < 1e-6);
    let nearest = |corner: DVec2| {
        let ends = walls.iter().flatten().map(|end| end.distance(corner));
        ends.fold(f64::INFINITY, f64::min)
    };
    corners.into_iter().map(nearest).collect()
}

/// Walls that reflect the predicted echoes of sweeps from given poses.
pub(crate) fn reflecting_walls(
    world: &World,
    poses: &[Pose],
    beams: usize,
) -> Result<BTreeSet<usize>, WorldError> {
    let simulator = world.simulator(&poses[0])?;
    let mut found = BTreeSet::new();
    for pose in poses {
        let point = simulator.at(pose.position());
        for at in 0..beams {
            let azimuth_deg = at as f64 * 360.0 / beams as f64;
            let predicted = point.ping(pose.direction_rad(azimuth_deg))?;
            let path = predicted.arrival.as_ref().map(|arrival| &arrival.path);
            found.extend(path.into_iter().flat_map(|path| path.reflectors()).filter_map(|of| {
                match of {
                    Reflector::Wall(wall) => Some(wall as usize),
                    _ => None,
                }
            }));
        }
    }
    Ok(found)
}

/// Share of readings that a scene predicts: echoes within 10 mm, and missing ones as such.
pub(crate) fn explained(
    world: &World,
    scene: Scene,
    sweeps: &[FitSweep],
    pose: impl Fn(&FitSweep) -> Pose,
) -> Result<f64, TooCostly> {
    const NEAR_M: f64 = 0.01;
    let mut world = world.clone();
    world.scene = Arc::new(scene);
    let Ok(simulator) = world.simulator(&Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 }) else {
        return Ok(0.0);
    };
    let (mut agreeing, mut count) = (0.0, 0.0);
    for sweep in sweeps {
        let pose = pose(sweep);
        let point = simulator.at(pose.position());
        for beam in &sweep.beams {
            let predicted = point.ping(pose.direction_rad(beam.azimuth_deg))?;
            let measured_m = beam.range_m(world.air.sound_speed_m_s());
            let agrees = match (measured_m, predicted.status, predicted.range_m) {
                (Some(a), PingStatus::Echo, Some(b)) => (a - b).abs() < NEAR_M,
                (None, status, _) => {
                    let is_near = beam.outcome == sonard_inverse::FiringOutcome::BelowMinRange;
                    status == if is_near { PingStatus::MinRange } else { PingStatus::NoEcho }
                }
                _ => false,
            };
            agreeing += f64::from(u8::from(agrees));
            count += 1.0;
        }
    }
    Ok(agreeing / f64::max(count, 1.0))
}

/// Median of values; not a number if there are none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Returns `true` if a place is within 2 cm of the axis of a post.
pub(crate) fn is_post_at(at: DVec2, post: &PostShape) -> bool {
    at.distance(post.center) < 0.02
}
