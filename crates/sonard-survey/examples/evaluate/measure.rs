//! Measures of a survey that need the model.

use std::{collections::BTreeSet, sync::Arc};

use sonard_inverse::{FitSweep, World, WorldError};
use sonard_model::{
    geometry::Pose,
    model::{Reflector, TooCostly},
    reading::PingStatus,
    scene::Scene,
};

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
