//! Corners at point features.

use sonard_model::geometry::{DVec2, distance_to_segment};

use super::plan_move::{PlanMove, to_next_wall};
use crate::arrangement::{LineArrangement, PieceSet, Run};

/// Maximum distance of a point feature from the corner of two lines, metres.
const AT_CORNER_M: f64 = 0.02;
/// Walls shorter than this, and as near to the corner as this, give way, metres.
const STUB_M: f64 = 0.3;
const NEAR_M: f64 = 0.05;
/// Distance from a corner to the piece beside it, metres.
const BESIDE_M: f64 = 1e-4;

/// Proposes pairs of walls from a corner at a point feature to the next walls, in place of stubs
/// there: alone neither of the two explains the echo of the corner.
pub(super) fn corners_at_points(
    plan: &LineArrangement,
    walls: &PieceSet,
    runs: &[Run],
) -> Vec<PlanMove> {
    let mut found = Vec::new();
    for a in 0..plan.lines.len() {
        for b in a + 1..plan.lines.len() {
            let corner = plan.lines[a].meet(&plan.lines[b]);
            let Some(corner) =
                corner.filter(|at| [a, b].iter().all(|&of| has_point(plan, of, *at)))
            else {
                continue;
            };
            let stubs = stubs(plan, runs, corner);
            let [of_a, of_b] = [a, b].map(|line| ways(plan, walls, line, corner));
            for first in &of_a {
                for second in &of_b {
                    let on = first.iter().chain(second).map(|&piece| (piece, true));
                    let off = stubs
                        .iter()
                        .filter(|piece| !first.contains(piece) && !second.contains(piece));
                    found.push(on.chain(off.map(|&piece| (piece, false))).collect());
                }
            }
        }
    }
    found
}

fn has_point(plan: &LineArrangement, line: usize, corner: DVec2) -> bool {
    let line = &plan.lines[line];
    let along_m = line.along_m(corner);
    line.points.iter().any(|point_m| (point_m - along_m).abs() < AT_CORNER_M)
}

/// Pieces from a corner to the next wall in both directions of a line.
fn ways(plan: &LineArrangement, walls: &PieceSet, line: usize, corner: DVec2) -> Vec<Vec<usize>> {
    let along_m = plan.lines[line].along_m(corner);
    let way = |(by_m, is_up): (f64, bool)| {
        let from = plan.piece_at(line, along_m + by_m);
        let pieces = to_next_wall(plan, walls, (line, from), is_up)?;
        Some(pieces.into_iter().map(|at| plan.piece(line, at)).collect())
    };
    [(BESIDE_M, true), (-BESIDE_M, false)].into_iter().filter_map(way).collect()
}

/// Pieces of short walls at a corner.
fn stubs(plan: &LineArrangement, runs: &[Run], corner: DVec2) -> Vec<usize> {
    let is_stub = |run: &&Run| {
        let wall = plan.segment(run);
        wall.a.distance(wall.b) < STUB_M && distance_to_segment(corner, wall.a, wall.b) < NEAR_M
    };
    let pieces = |run: &Run| {
        let line = run.line;
        (run.first..=run.last).map(move |at| plan.piece(line, at))
    };
    runs.iter().filter(is_stub).flat_map(pieces).collect()
}
