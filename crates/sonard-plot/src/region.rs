//! Region of the floor shown on a scan's plan.

use super::{plan::Bounds, readings::PlottedScan};
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::Scene,
};

/// Maximum extension of the view past the walls on each side, relative to the room's size in that
/// direction: the mirror image behind each wall still fits, and with it false walls such
/// as in Dudek and others, figure 9.
const MARGIN: f64 = 1.05;
/// Minimum of that limit relative to the longer side, for long rooms or a single wall.
const MIN_MARGIN: f64 = 0.3;
/// Fraction of the readings that may remain outside the view to keep the room large.
const OUTSIDE_FRACTION: f64 = 0.01;

/// Region to show: the room with the readings not too far outside it, or without a scene the bulk
/// of the readings.
pub(super) fn region(scans: &[(Pose, &PlottedScan)], scene: Option<&Scene>) -> Bounds {
    let points: Vec<DVec2> = scans.iter().flat_map(|(pose, scan)| points(pose, scan)).collect();
    let poses = || scans.iter().map(|(pose, _)| pose.position());
    let walls = scene.and_then(Bounds::from_scene);
    let region = match walls {
        Some(walls) => {
            let room = walls.including(poses().filter(|at| near(&walls, *at)));
            reach_out(room, &points)
        }
        None => {
            let around = Bounds::around(poses()).map(|b| bulk(b, &points));
            around.unwrap_or(Bounds { min: DVec2::ZERO, max: DVec2::ONE })
        }
    };
    let size = region.size().max_element();
    region.grown(if size > 0.0 { 0.06 * size } else { 0.5 })
}

/// World positions of readings and predictions.
fn points<'a>(pose: &'a Pose, scan: &'a PlottedScan) -> impl Iterator<Item = DVec2> + 'a {
    scan.beams
        .iter()
        .flat_map(|beam| {
            [beam.range_m, beam.model_range_m]
                .into_iter()
                .flatten()
                .map(|range_m| beam.point(pose, range_m))
        })
        .filter(|point| point.is_finite())
}

/// Returns `false` for a pose so far outside its room that it would shrink the room to a dot.
fn near(walls: &Bounds, at: DVec2) -> bool {
    let grown = walls.grown(walls.size().max_element());
    at.cmpge(grown.min).all() && at.cmple(grown.max).all()
}

/// Extends each side to the readings beyond it, except for a few and for distant ones.
fn reach_out(room: Bounds, points: &[DVec2]) -> Bounds {
    let size = room.size();
    let limit = (MARGIN * size).max(DVec2::splat(MIN_MARGIN * size.max_element()));
    let spare = (OUTSIDE_FRACTION * points.len() as f64).ceil() as usize;
    let side = |limit: f64, excess: &dyn Fn(&DVec2) -> f64| {
        let mut beyond: Vec<f64> =
            points.iter().map(excess).filter(|by| (0.0..=limit).contains(by)).collect();
        beyond.sort_by(|a, b| b.total_cmp(a));
        beyond.get(spare).copied().unwrap_or(0.0)
    };
    let (low, high) = (room.min, room.max);
    Bounds {
        min: low - DVec2::new(side(limit.x, &|p| low.x - p.x), side(limit.y, &|p| low.y - p.y)),
        max: high + DVec2::new(side(limit.x, &|p| p.x - high.x), side(limit.y, &|p| p.y - high.y)),
    }
}

/// Bounds of the readings within 1.5 times the 90th percentile of the distance.
fn bulk(poses: Bounds, points: &[DVec2]) -> Bounds {
    let middle = (poses.min + poses.max) / 2.0;
    let mut distances: Vec<f64> = points.iter().map(|p| p.distance(middle)).collect();
    distances.sort_by(f64::total_cmp);
    let Some(p90) = distances.get(distances.len() * 9 / 10) else { return poses };
    poses.including(points.iter().copied().filter(|p| p.distance(middle) <= 1.5 * p90))
}
