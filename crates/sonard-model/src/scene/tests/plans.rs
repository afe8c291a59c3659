//! Plans that are made of walls as they were drawn.

use super::{
    standing::{plan_of, single},
    *,
};

fn plan(walls: &[String]) -> (Scene, FloorPlan) {
    let texts: Vec<&str> = walls.iter().map(String::as_str).collect();
    let scene = plan_of(&texts, "");
    let plan = scene.floor_plan();
    (scene, plan)
}

fn described(scene: &Scene, plan: &FloorPlan) -> Vec<String> {
    plan.changes.iter().map(|change| change.describe(scene)).collect()
}

/// A wall that stops half a millimetre short of another ends on it.
#[test]
fn a_joint_is_closed_and_told_in_millimetres() {
    let (scene, plan) =
        plan(&[single("long", [0.3, 1.0], [4.3, 1.0]), single("t", [2.1, 1.0005], [2.1, 3.0])]);
    let (foot, far) = plan.walls[1];
    assert!(foot.distance(DVec2::new(2.1, 1.0)) < 1e-9 && far == DVec2::new(2.1, 3.0), "{foot}");
    assert_eq!(plan.walls[0], (DVec2::new(0.3, 1.0), DVec2::new(4.3, 1.0)));
    assert_eq!(
        described(&scene, &plan),
        ["t.a at (2.1000, 1.0005): moved by 0.500 mm, it stopped short of long"]
    );
    // Three pieces meet there.
    assert_eq!(plan.arrangement.pieces.len(), 3);
}

/// One that ends near where two cross ends in their crossing.
#[test]
fn where_two_walls_cross_a_third_ends_in_the_crossing() {
    let (_, plan) = plan(&[
        single("one", [0.2, 1.0], [4.2, 1.0]),
        single("other", [1.2, 0.1], [2.2, 2.1]),
        single("third", [1.6506, 0.9995], [3.0, -1.3]),
    ]);
    let (end, _) = plan.walls[2];
    assert!(end.distance(DVec2::new(1.65, 1.0)) < 1e-9, "{end}");
}

/// Where a wall goes straight on, in its own material, nothing happens.
#[test]
fn joints_of_one_line_are_straight_and_bends_are_not() {
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
