//! Parts of rooms that readings leave open.

use super::*;
use crate::{
    alternatives::assess, judge::Judge, posed::PosedPlan, progress::NoObserver, result::PieceStatus,
};

/// A wall behind the walls of a closed room can't be observed, and neither can a wall across the
/// room that is not there.
#[test]
fn wall_without_evidence_is_never_observed() {
    let (corners, poses) = (rectangle(), stops());
    let world = world(&corners);
    let sweeps = sweeps(&world, &poses, &poses);
    let workspace = true_workspace(&world, &sweeps, &NoObserver);
    let judge = Judge::new(&workspace, &poses, 0.004);
    let along = (corners[1] - corners[0]).normalize();
    let behind = [corners[0] - 0.5 * along.perp(), corners[1] - 0.5 * along.perp()];
    // From wall to wall, where no stop is beyond it.
    let from = corners[0].lerp(corners[1], 0.93);
    let inside = [from, from + SIZE_M[1] * along.perp()];
    for extra in [behind, inside] {
        let mut walls = sides(&corners);
        walls.push(extra);
        let (plan, set) = plan_of(&walls, &poses);
        let posed = PosedPlan { plan, walls: set, poses: poses.clone() };
        let assessment = assess(&posed, &judge);
        let added: Vec<_> = assessment.walls.iter().filter(|wall| wall.segment.line == 4).collect();
        assert!(!added.is_empty());
        for wall in added {
            assert!(wall.evidence_nats < 0.0, "{wall:?}");
            let is_observed = wall.pieces.iter().any(|piece| piece.status == PieceStatus::Observed);
            assert!(!is_observed, "{wall:?}");
        }
        // The plan without it is better.
        assert!(assessment.better.is_some());
    }
}
