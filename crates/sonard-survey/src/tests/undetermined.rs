//! Parts of rooms that readings leave open.

use super::*;
use crate::{
    alternatives::assess, judge::Judge, posed::PosedPlan, progress::NoObserver,
    result::PieceStatus, symmetry::equivalent_poses,
};

/// A wall behind the walls of a closed room can't be observed, and neither can a wall across the
/// room that is not there.
#[test]
fn wall_without_evidence_is_never_observed() {
    let (corners, poses) = (rectangle(), stops());
    let world = world(&corners);
    let sweeps = sweeps(&world, &poses, &poses);
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
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

/// A rectangle looks alike from two poses half a turn apart; odometry excludes one of them.
#[test]
fn half_turn_of_a_rectangle_is_open_without_odometry() {
    let (corners, poses) = (rectangle(), stops());
    let world = world(&corners);
    let sweeps = sweeps(&world, &poses, &poses);
    let (plan, walls) = plan_of(&sides(&corners), &poses);
    let posed = PosedPlan { plan, walls, poses: poses.clone() };
    for odometry in [None, options().odometry] {
        let scores = PlanScores::default();
        let options = SurveyOptions { odometry, ..options() };
        let workspace =
            workspace(&world, &sweeps, &options, (&NoObserver, &scores)).expect("sweeps");
        let found = equivalent_poses(&posed, &Judge::new(&workspace, &poses, 0.004));
        assert!(found[0].is_empty());
        let (center, is_open) = (corners[0].midpoint(corners[2]), odometry.is_none());
        for (equivalent, pose) in found.iter().zip(&poses).skip(1) {
            assert_eq!(equivalent.len(), usize::from(is_open), "{equivalent:?}");
            for other in equivalent {
                assert!(other.position().distance(2.0 * center - pose.position()) < 1e-6);
                assert!((other.heading_deg - pose.heading_deg).abs() - 180.0 < 1e-6);
            }
        }
    }
}
