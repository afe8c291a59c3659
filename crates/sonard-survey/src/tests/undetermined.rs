//! Parts of rooms that readings leave open.

use super::*;
use crate::{
    alternatives::assess, judge::Judge, posed::PosedPlan, progress::NoObserver, refine::refine,
    relocate::relocated, result::PieceStatus, symmetry::equivalent_poses,
};

/// A wall behind the walls of a closed room can't be observed, and neither can a wall across the
/// room that is not there.
#[test]
fn wall_without_evidence_is_never_observed() {
    let (corners, poses, world, sweeps) = true_rectangle();
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
        let posed = PosedPlan { plan, walls: set, posts: Vec::new(), poses: poses.clone() };
        let assessment = assess(&posed, &judge, None);
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

/// A course with two wrong poses of four explains half of the arcs only.
#[test]
fn walls_of_a_lost_course_are_not_observed() {
    let (corners, truth, world, sweeps) = true_rectangle();
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let observed = |poses: &[Pose]| {
        let judge = Judge::new(&workspace, poses, 0.004);
        let (plan, walls) = plan_of(&sides(&corners), poses);
        let assessment = assess(
            &PosedPlan { plan, walls, posts: Vec::new(), poses: poses.to_vec() },
            &judge,
            None,
        );
        let pieces = assessment.walls.iter().flat_map(|wall| &wall.pieces);
        pieces.filter(|piece| piece.status == PieceStatus::Observed).count()
    };
    assert!(observed(&truth) >= 4);
    let mut poses = truth.clone();
    for pose in &mut poses[2..] {
        (pose.x_m, pose.heading_deg) = (pose.x_m - 0.3, pose.heading_deg + 40.0);
    }
    assert_eq!(observed(&poses), 0);
}

/// Walls whose directions or distances have wide intervals are there, but not observed.
#[test]
fn walls_with_wide_intervals_are_not_observed() {
    let (corners, poses, world, sweeps) = true_rectangle();
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let judge = Judge::new(&workspace, &poses, 0.004);
    let (plan, walls) = plan_of(&sides(&corners), &poses);
    let mut posed = PosedPlan { plan, walls, posts: Vec::new(), poses: poses.clone() };
    let covariance = refine(&mut posed, &judge, 0.012, 3).expect("a determined plan");
    let assessed =
        |widened: f64| assess(&posed, &judge, Some(&covariance.scaled(widened * widened))).walls;
    let observed = |widened: f64| {
        let walls = assessed(widened);
        let pieces = walls.iter().flat_map(|wall| &wall.pieces);
        pieces.filter(|piece| piece.status == PieceStatus::Observed).count()
    };
    assert!(observed(1.0) >= 4);
    let sigma_deg = assessed(1.0).into_iter().map(|wall| wall.sigma.expect("a line of the fit")[0]);
    let least_deg = sigma_deg.fold(f64::INFINITY, f64::min);
    assert_eq!(observed(3.1 / least_deg), 0);
}

/// A rectangle looks alike from two poses half a turn apart; odometry excludes one of them.
#[test]
fn half_turn_of_a_rectangle_is_open_without_odometry() {
    let (corners, poses, world, sweeps) = true_rectangle();
    let (plan, walls) = plan_of(&sides(&corners), &poses);
    let posed = PosedPlan { plan, walls, posts: Vec::new(), poses: poses.clone() };
    for odometry in [None, options().odometry] {
        let scores = PlanScores::default();
        let options = SurveyOptions { odometry, ..options() };
        let workspace =
            workspace(&world, ((&sweeps).into(), &sweeps), &options, (&NoObserver, &scores))
                .expect("sweeps");
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

/// A pose far from the true one, by which the walls of the others explain nothing.
#[test]
fn lost_sweep_is_located_in_the_plan_of_the_others() {
    let (corners, truth, world, sweeps) = true_rectangle();
    let options = SurveyOptions { odometry: None, ..options() };
    let scores = PlanScores::default();
    let workspace =
        workspace(&world, ((&sweeps).into(), &sweeps), &options, (&NoObserver, &scores))
            .expect("sweeps");
    let mut poses = truth.clone();
    let posed = |poses: &[Pose]| {
        let (plan, walls) = plan_of(&sides(&corners), poses);
        PosedPlan { plan, walls, posts: Vec::new(), poses: poses.to_vec() }
    };
    assert_eq!(relocated(&posed(&truth), &Judge::new(&workspace, &truth, 0.004)), None);
    poses[2] = Pose { x_m: truth[2].x_m - 0.3, y_m: truth[2].y_m - 0.2, heading_deg: 40.0 };
    let found = relocated(&posed(&poses), &Judge::new(&workspace, &poses, 0.004));
    let found = found.expect("a better pose");
    // The room looks alike from the pose half a turn away.
    let half_turn = 2.0 * corners[0].midpoint(corners[2]) - truth[2].position();
    let off_m = [truth[2].position(), half_turn].map(|at| at.distance(found[2].position()));
    assert!(off_m.iter().any(|off_m| *off_m < 0.005), "{off_m:?}");
    assert_eq!([found[0], found[1], found[3]], [truth[0], truth[1], truth[3]]);
}

/// An arc of clutter in each sweep is too little for a wrong pose, but more than a complete plan
/// leaves in all sweeps together.
#[test]
fn walls_among_unexplained_arcs_are_not_observed() {
    let (corners, truth, world, clear) = true_rectangle();
    let mut cluttered = clear.clone();
    for sweep in &mut cluttered {
        for beam in &mut sweep.beams[100..116] {
            let tof_us = 2e6 * 0.35 / world.air.sound_speed_m_s();
            beam.outcome = FiringOutcome::Echo { tof_us };
        }
    }
    for (sweeps, is_observed) in [(clear, true), (cluttered, false)] {
        let scores = PlanScores::default();
        let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
        let judge = Judge::new(&workspace, &truth, 0.004);
        let (plan, walls) = plan_of(&sides(&corners), &truth);
        let assessment = assess(
            &PosedPlan { plan, walls, posts: Vec::new(), poses: truth.clone() },
            &judge,
            None,
        );
        let mut pieces = assessment.walls.iter().flat_map(|wall| &wall.pieces);
        assert_eq!(pieces.any(|piece| piece.status == PieceStatus::Observed), is_observed);
    }
}
