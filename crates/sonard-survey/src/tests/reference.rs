//! Predictions reused for plans that differ in a few walls.

use rand::{SeedableRng, seq::IndexedRandom};
use rand_pcg::Pcg64;

use super::*;
use crate::{
    judge::{Judge, ReferencePlan, ScoreContext},
    moves::MoveFinder,
    progress::NoObserver,
    trial::{RoomKind, draw_trial, trial_world},
};

/// Scores by the predictions of another plan equal those by new predictions, for changes in random
/// rooms and for chains of them.
#[test]
fn reused_predictions_give_the_scores_of_new_ones() {
    let mut random = Pcg64::seed_from_u64(3);
    let mut compared = 0;
    for kind in [RoomKind::Cut, RoomKind::L, RoomKind::Box, RoomKind::Posts] {
        let (scene, poses) = draw_trial(kind, 4, &mut random).expect("a room");
        let world = trial_world(scene.clone()).expect("a world");
        let sweeps = sweeps(&world, &poses, &poses);
        let scores = PlanScores::default();
        let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
        let direct = Judge::new(&workspace, &poses, 0.006);
        let walls: Vec<_> = scene.walls.iter().map(|wall| [wall.a, wall.b]).collect();
        let (plan, mut walls) = plan_of(&walls, &poses);
        let fresh = PlanScores::default();
        let workspace = true_workspace(&world, &sweeps, (&NoObserver, &fresh));
        let judge = Judge::new(&workspace, &poses, 0.006);
        let mut reference = ReferencePlan::new(&judge, &plan.segments(&walls)).expect("few paths");
        for _ in 0..4 {
            let moves = MoveFinder::new(&plan, &poses).moves(&walls);
            for change in moves.sample(&mut random, 15) {
                let changed = walls.changed(change);
                let new = direct.score(&plan, &changed);
                let context = ScoreContext::default().near(Some(&reference));
                let reused = judge.score_above(&plan, &changed, context).expect("no floor");
                assert!((new - reused).abs() < 1e-5, "{kind} {change:?}: {new} and {reused}");
                compared += 1;
            }
            let Some(change) = moves.choose(&mut random) else { break };
            walls = walls.changed(change);
            reference = reference.followed_by(&judge, &plan.segments(&walls)).expect("few paths");
        }
    }
    assert!(compared > 100, "{compared}");
}
