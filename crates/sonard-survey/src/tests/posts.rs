//! A post inside of a room.

use sonard_model::scene::Cylinder;

use super::*;
use crate::{
    PieceStatus,
    judge::Judge,
    posed::PosedPlan,
    post::PostShape,
    posts::{PostKind, with_new_posts, without_idle_posts},
    progress::NoObserver,
    survey::{score_plan, survey},
    trace::unexplained_by,
};

/// Post clear of the stops.
fn post() -> PostShape {
    let center = DVec2::from_angle(TURN_RAD).rotate(DVec2::new(2.1, 0.6));
    PostShape { center, radius_m: 0.06 }
}

fn world_with_post() -> World {
    let mut world = world(&rectangle());
    let mut scene = Scene::clone(&world.scene);
    let PostShape { center, radius_m } = post();
    let material = scene.walls[0].material;
    scene.cylinders.push(Cylinder { id: "post".into(), center, radius_m, material, z_m: None });
    world.scene = Arc::new(scene);
    world
}

/// Plan of these walls at the true stops.
fn posed(walls: &[[DVec2; 2]]) -> PosedPlan {
    let poses = stops();
    let (plan, walls) = plan_of(walls, &poses);
    PosedPlan { plan, walls, posts: Vec::new(), poses }
}

/// Plan with posts added at arcs that others leave unexplained.
fn grown(world: &World, from: &PosedPlan) -> Option<PosedPlan> {
    let (poses, scores) = (stops(), PlanScores::default());
    let sweeps = sweeps(world, &poses, &poses);
    let workspace = true_workspace(world, &sweeps, (&NoObserver, &scores));
    let judge = Judge::of(&workspace, from, 0.004);
    with_new_posts(from, &judge, PostKind::Round, |posed| unexplained_by(posed, &workspace))
}

#[test]
fn post_is_found_at_unexplained_arcs() {
    let found = grown(&world_with_post(), &posed(&sides(&rectangle()))).expect("a post");
    let [found] = &found.posts[..] else { panic!("{:?}", found.posts) };
    assert!(found.center.distance(post().center) < 0.003, "{found:?}");
    assert!((found.radius_m - post().radius_m).abs() < 0.003, "{found:?}");
    assert!(grown(&world(&rectangle()), &posed(&sides(&rectangle()))).is_none());
}

/// Walls at the echoes of a post explain them in part.
#[test]
fn post_replaces_walls_at_its_echoes() {
    let mut walls = sides(&rectangle());
    for stop in &stops()[..2] {
        let from = (stop.position() - post().center).normalize();
        let foot = post().center + post().radius_m * from;
        walls.push([foot - 0.1 * from.perp(), foot + 0.1 * from.perp()]);
    }
    let found = grown(&world_with_post(), &posed(&walls)).expect("a post");
    assert_eq!((found.posts.len(), found.plan.runs(&found.walls).len()), (1, 4));
}

#[test]
fn post_without_evidence_is_removed() {
    let world = world_with_post();
    let (poses, scores) = (stops(), PlanScores::default());
    let sweeps = sweeps(&world, &poses, &poses);
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let mut plan = posed(&sides(&rectangle()));
    // No echo of the second post is above the threshold of any reading: a wall is nearer to it.
    let hidden = DVec2::from_angle(TURN_RAD).rotate(DVec2::new(SIZE_M[0] + 0.5, 1.0));
    plan.posts = vec![post(), PostShape { center: hidden, radius_m: 0.05 }];
    let judge = Judge::of(&workspace, &plan, 0.004);
    let fewer = without_idle_posts(&plan, &judge).expect("an idle post");
    assert_eq!(fewer.posts, [post()]);
    assert!(without_idle_posts(&fewer, &judge.at(&fewer)).is_none());
}

#[test]
fn room_with_a_post_is_found_from_drifting_odometry() {
    let (corners, poses, world) = (rectangle(), stops(), world_with_post());
    let readings = sweeps(&world, &poses, &drifted(&poses));
    let found = survey(&world, &readings, &options(), &NoObserver).expect("a survey");
    assert_eq!((found.walls.len(), found.posts.len()), (4, 1), "{found:#?}");
    let of = &found.posts[0];
    assert_eq!(of.status, PieceStatus::Observed);
    assert!(of.sweeps >= 2 && of.evidence_nats > 10.0, "{of:?}");
    let (off, sigma_m) = (DVec2::from(of.center_m) - post().center, of.sigma_m.expect("intervals"));
    assert!(off.abs().cmplt(3.0 * DVec2::from(sigma_m)).all() && off.length() < 0.01, "{of:?}");
    assert!((of.radius_m - post().radius_m).abs() < 0.002, "{of:?}");
    let sweeps = sweeps(&world, &poses, &poses);
    let truth = score_plan(&world, &sweeps, &options(), (&sides(&corners), &[post()]), &poses);
    assert!((found.score - truth.expect("a score")).abs() < 3.0, "{}", found.score);
    let scene = found.scene("found", false).build().expect("a valid scene");
    assert_eq!((scene.walls.len(), scene.cylinders.len()), (4, 1));
}
