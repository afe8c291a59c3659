//! A box inside of a room.

use super::*;
use crate::{boxes::with_box, judge::Judge, posed::PosedPlan, progress::NoObserver};

/// Corners of a box in the frame of the rectangle, clear of the stops.
fn block() -> Vec<DVec2> {
    let turn = DVec2::from_angle(TURN_RAD);
    [[1.75, 0.35], [2.15, 0.35], [2.15, 0.7], [1.75, 0.7]].map(|at| turn.rotate(at.into())).to_vec()
}

fn world_with_block() -> World {
    let mut world = world(&rectangle());
    let [room, block] = [rectangle(), block()]
        .map(|corners| corners.iter().map(|corner| corner.to_array()).collect::<Vec<_>>());
    let scene = Scene::builder("room").material("wall", 0.97).room("wall", &room, "wall");
    world.scene = Arc::new(scene.room("box", &block, "wall").build().expect("a scene"));
    world
}

/// From the middle of one face the other three sides are found.
#[test]
fn box_is_completed_from_a_part_of_one_face() {
    let poses = stops();
    let world = world_with_block();
    let sweeps = sweeps(&world, &poses, &poses);
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let judge = Judge::new(&workspace, &poses, 0.004);
    let all: Vec<_> = sides(&rectangle()).into_iter().chain(sides(&block())).collect();
    let (plan, walls) = plan_of(&all, &poses);
    let truth = judge.score(&plan, &walls);
    // The face towards most stops.
    let [a, b] = sides(&block())[2];
    let mut part = sides(&rectangle());
    part.push([a.lerp(b, 0.3), a.lerp(b, 0.6)]);
    let (plan, walls) = plan_of(&part, &poses);
    let posed = PosedPlan { plan, walls, posts: Vec::new(), poses: poses.clone() };
    let found = with_box(&posed, &judge, &[]).expect("a box");
    let score = judge.score(&found.plan, &found.walls);
    assert!(score > truth - 2.0, "{score} {truth}");
    let segments = found.plan.segments(&found.walls);
    assert_eq!(segments.len(), 8, "{segments:?}");
    for corner in block() {
        let ends = segments.iter().flat_map(|wall| [wall.a, wall.b]);
        let off_m = ends.map(|end| corner.distance(end)).fold(f64::INFINITY, f64::min);
        assert!(off_m < 0.005, "{corner}: {off_m}");
    }
    // In a room without boxes there is nothing to complete.
    let (plan, walls) = plan_of(&sides(&rectangle()), &poses);
    let posed = PosedPlan { plan, walls, posts: Vec::new(), poses };
    assert!(with_box(&posed, &judge, &[]).is_none());
}
