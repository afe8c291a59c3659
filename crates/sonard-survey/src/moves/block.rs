//! Closed blocks, such as boxes and pillars, free in a room.

use std::cmp::Reverse;

use sonard_model::geometry::{DVec2, Pose, encloses};

use super::plan_move::PlanMove;
use crate::arrangement::LineArrangement;

/// Maximum angle between opposite sides, radians.
const PARALLEL_RAD: f64 = 0.09;
/// Limits of the distance between opposite sides, metres.
const SIDE_M: [f64; 2] = [0.1, 1.2];
/// Maximum distance of a point feature from a corner, metres.
const AT_CORNER_M: f64 = 0.02;
/// Minimum number of corners with a point feature.
const MIN_POINTS: usize = 2;
/// Maximum number of blocks, those with most points first.
const MAX_BLOCKS: usize = 120;

/// Proposes the four sides of blocks at once: alone the far sides explain little.
pub(super) fn blocks(plan: &LineArrangement, poses: &[Pose]) -> Vec<PlanMove> {
    let pairs = parallel_pairs(plan);
    let mut found: Vec<(usize, PlanMove)> = Vec::new();
    for (at, &[a, b]) in pairs.iter().enumerate() {
        for &[c, d] in &pairs[at + 1..] {
            let Some(corners) = corners(plan, [a, c, b, d]) else { continue };
            let points = corners.iter().filter(|corner| has_point(plan, **corner)).count();
            let is_clear = poses.iter().all(|pose| !encloses(&corners, pose.position()));
            let side_m = corners[0].distance(corners[1]);
            if points >= MIN_POINTS && is_clear && (SIDE_M[0]..SIDE_M[1]).contains(&side_m) {
                found.push((points, sides(plan, [a, c, b, d], &corners)));
            }
        }
    }
    found.sort_by_key(|(points, _)| Reverse(*points));
    found.truncate(MAX_BLOCKS);
    found.into_iter().map(|(_, sides)| sides).collect()
}

fn parallel_pairs(plan: &LineArrangement) -> Vec<[usize; 2]> {
    let mut pairs = Vec::new();
    for a in 0..plan.lines.len() {
        for b in a + 1..plan.lines.len() {
            let (first, second) = (&plan.lines[a], &plan.lines[b]);
            let apart_m = second.off_m(first.anchor(DVec2::ZERO)).abs();
            if first.angle_to(second) < PARALLEL_RAD && (SIDE_M[0]..SIDE_M[1]).contains(&apart_m) {
                pairs.push([a, b]);
            }
        }
    }
    pairs
}

/// Corners between neighbouring sides.
fn corners(plan: &LineArrangement, sides: [usize; 4]) -> Option<[DVec2; 4]> {
    let meet = |at: usize| plan.lines[sides[at]].meet(&plan.lines[sides[(at + 1) % 4]]);
    Some([meet(0)?, meet(1)?, meet(2)?, meet(3)?])
}

fn has_point(plan: &LineArrangement, corner: DVec2) -> bool {
    plan.lines.iter().any(|line| {
        line.off_m(corner).abs() < AT_CORNER_M
            && line.points.iter().any(|at| (at - line.along_m(corner)).abs() < AT_CORNER_M)
    })
}

/// Pieces of each side between its corners.
fn sides(plan: &LineArrangement, sides: [usize; 4], corners: &[DVec2; 4]) -> PlanMove {
    let mut change = Vec::new();
    for (at, &line) in sides.iter().enumerate() {
        let ends = [corners[(at + 3) % 4], corners[at]].map(|end| plan.lines[line].along_m(end));
        let [from, to] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        for piece in 1..plan.pieces_of(line).saturating_sub(1) {
            let cuts = &plan.cuts[line];
            let middle = 0.5 * (cuts[piece].along_m + cuts[piece + 1].along_m);
            if from < middle && middle < to {
                change.push((plan.piece(line, piece), true));
            }
        }
    }
    change
}
