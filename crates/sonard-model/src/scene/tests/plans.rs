//! Floor plans derived from walls as drawn.

use super::{
    accessibility::{scene_with_walls, single},
    *,
};

fn plan(walls: &[String]) -> (Scene, FloorPlan) {
    let texts: Vec<&str> = walls.iter().map(String::as_str).collect();
    let scene = scene_with_walls(&texts, "");
    let plan = scene.floor_plan();
    (scene, plan)
}

fn described(scene: &Scene, plan: &FloorPlan) -> Vec<String> {
    plan.changes.iter().map(|change| change.describe(scene)).collect()
}

/// A wall that ends half a millimetre short of another is extended to it.
#[test]
fn closes_and_describes_a_joint() {
    let (scene, plan) =
        plan(&[single("long", [0.3, 1.0], [4.3, 1.0]), single("t", [2.1, 1.0005], [2.1, 3.0])]);
    let (foot, far) = plan.walls[1];
    assert!(foot.distance(DVec2::new(2.1, 1.0)) < 1e-9 && far == DVec2::new(2.1, 3.0), "{foot}");
    assert_eq!(plan.walls[0], (DVec2::new(0.3, 1.0), DVec2::new(4.3, 1.0)));
    assert_eq!(
        described(&scene, &plan),
        ["t.a at (2.1000, 1.0005): moved by 0.500 mm, short of long"]
    );
    // The arrangement has three pieces.
    assert_eq!(plan.arrangement.pieces.len(), 3);
}

/// A wall that ends near the crossing of two others is moved to the crossing.
#[test]
fn third_wall_ends_in_the_crossing() {
    let (_, plan) = plan(&[
        single("one", [0.2, 1.0], [4.2, 1.0]),
        single("other", [1.2, 0.1], [2.2, 2.1]),
        single("third", [1.6506, 0.9995], [3.0, -1.3]),
    ]);
    let (end, _) = plan.walls[2];
    assert!(end.distance(DVec2::new(1.65, 1.0)) < 1e-9, "{end}");
}

/// A joint is straight where a wall continues in the same material.
#[test]
fn collinear_joints_are_straight() {
    let (scene, plan) = plan(&[
        single("one", [1.0, 1.0], [2.0, 1.5]),
        single("two", [2.0, 1.5], [4.0, 2.5]),
        single("bent", [4.0, 2.5], [5.0, 2.0]),
    ]);
    let is_straight = plan.straight_joints(&scene);
    for (point, straight) in plan.arrangement.points.iter().zip(is_straight) {
        assert_eq!(straight, *point == DVec2::new(2.0, 1.5), "{point}");
    }
    let mut other = scene.clone();
    other.walls[1].material.reflectance = 0.5;
    assert!(!plan.straight_joints(&other).contains(&true));
}
