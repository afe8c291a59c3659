//! Accessible positions of a ranger.

use super::*;

#[test]
fn ranger_needs_free_space() {
    let scene = good();
    let rejection = |x_m: f64, y_m: f64| {
        scene.check_pose(&Pose { x_m, y_m, heading_deg: 0.0 }).err().map(|error| error.to_string())
    };
    assert_eq!(rejection(0.5, 0.5), None);
    // In the bounding box of the triangular pillar, but not in the triangle.
    assert_eq!(rejection(1.2, 1.8), None);
    for (x_m, y_m, message) in [
        (-1.0, 1.0, "outside the room"),
        (1.8, 1.2, "inside `pillar`"),
        (3.0, 2.05, "inside `leg`"),
        (2.0, 0.0005, "0.50 mm from `south`"),
        (3.0, 2.1005, "0.50 mm from `leg`"),
        (f64::NAN, 1.0, ""),
    ] {
        let found = rejection(x_m, y_m).unwrap_or_default();
        assert!(!found.is_empty() && found.contains(message), "({x_m}, {y_m}): {found}");
    }
}

#[test]
fn single_ring_depends_on_poses() {
    let single_ring = |pose: &str| {
        Scene::from_json(&format!(
            r#"{{"name": "ring", "materials": {{"m": {{"reflectance": 1}}}},
               "walls": [{{"id": "ring", "polyline": [[0,0],[1,0],[1,1],[0,1]], "closed": true, "material": "m"}}],
               "poses": {{{pose}}}}}"#
        ))
        .expect("a single ring")
    };
    let (inside, outside) = (
        Pose { x_m: 0.5, y_m: 0.5, heading_deg: 0.0 },
        Pose { x_m: 2.0, y_m: 0.5, heading_deg: 0.0 },
    );
    let room = single_ring("");
    assert_eq!(room.check_pose(&inside), Ok(()));
    assert!(matches!(room.check_pose(&outside), Err(PoseError::OutsideRoom { .. })));
    let body = single_ring(r#""p": {"x_m": 3, "y_m": 3}"#);
    assert!(matches!(body.check_pose(&inside), Err(PoseError::InsideBody { .. })));
    assert_eq!(body.check_pose(&outside), Ok(()));
}

#[test]
fn open_walls_enclose_nothing() {
    let open = GOOD.replace(", [0, 0]], \"material\"", "], \"material\"");
    let scene = Scene::from_json(&open).expect("an open room");
    let outside = Pose { x_m: -1.0, y_m: 1.0, heading_deg: 0.0 };
    assert_eq!(scene.check_pose(&outside), Ok(()));
    for pose in [Pose { x_m: f64::NAN, ..outside }, Pose { heading_deg: f64::INFINITY, ..outside }]
    {
        assert!(matches!(scene.check_pose(&pose), Err(PoseError::BadNumber { .. })), "{pose:?}");
    }
}

/// Scene of walls and additional members.
pub(super) fn scene_with_walls(walls: &[&str], more: &str) -> Scene {
    let text = format!(
        r#"{{"name": "plan", "materials": {{"m": {{"reflectance": 0.9}}}}, "walls": [{}] {more}}}"#,
        walls.join(",")
    );
    Scene::from_json(&text).unwrap_or_else(|error| panic!("{error}"))
}

fn ring(id: &str, [x, y]: [f64; 2], [width, depth]: [f64; 2]) -> String {
    let (right, top) = (x + width, y + depth);
    format!(
        r#"{{"id": "{id}", "polyline": [[{x},{y}],[{right},{y}],[{right},{top}],[{x},{top}]], "closed": true, "material": "m"}}"#
    )
}

pub(super) fn single(id: &str, from: [f64; 2], to: [f64; 2]) -> String {
    format!(r#"{{"id": "{id}", "from": {from:?}, "to": {to:?}, "material": "m"}}"#)
}

#[test]
fn access_is_order_independent() {
    let rejection = |scene: &Scene, [x_m, y_m]: [f64; 2]| {
        let error = scene.check_pose(&Pose { x_m, y_m, heading_deg: 0.0 }).err();
        error.map_or_else(String::new, |error| error.to_string())
    };
    let room = || ring("A", [0.0, 0.0], [4.0, 3.0]);
    let beyond = || ring("B", [4.0, 0.0], [3.0, 3.0]);
    let three_sides = || {
        vec![
            single("s", [4.0, 0.0], [7.0, 0.0]),
            single("e", [7.0, 0.0], [7.0, 3.0]),
            single("n", [7.0, 3.0], [4.0, 3.0]),
        ]
    };
    type Case = (&'static str, Vec<String>, &'static [([f64; 2], &'static str)]);
    let cases: Vec<Case> = vec![
        (
            "two rooms with a common wall",
            vec![room(), beyond()],
            &[([1.0, 1.0], ""), ([5.0, 1.0], ""), ([9.0, 1.0], "outside")],
        ),
        (
            "a room on another one's wall",
            [vec![room()], three_sides()].concat(),
            &[([1.0, 1.0], ""), ([5.0, 1.0], ""), ([9.0, 1.0], "outside")],
        ),
        (
            "two rooms, the wall by hand",
            vec![room(), ring("B", [4.0007, 0.0004], [3.0, 2.9992])],
            &[([1.0, 1.0], ""), ([5.0, 1.0], ""), ([9.0, 1.0], "outside")],
        ),
        (
            "a pillar outside",
            vec![room(), ring("P", [6.0, 1.0], [0.3, 0.3])],
            &[([1.0, 1.0], ""), ([6.1, 1.1], "inside `P`"), ([5.0, 1.0], "")],
        ),
        (
            "a hut with a screen in it",
            vec![room(), ring("H", [6.0, 1.0], [0.3, 0.3]), single("p", [6.1, 1.2], [6.2, 1.2])],
            &[([1.0, 1.0], ""), ([6.1, 1.1], ""), ([5.0, 1.0], "outside")],
        ),
        (
            "a box poking out",
            vec![room(), ring("P", [3.5, 1.0], [1.0, 0.5])],
            &[
                ([1.0, 1.0], ""),
                ([3.7, 1.2], "inside `P`"),
                ([4.2, 1.2], "inside `P`"),
                ([9.0, 1.0], "outside"),
            ],
        ),
        (
            "a partition past its wall",
            vec![room(), single("p", [2.0, -0.2], [2.0, 1.5])],
            &[
                ([1.0, 1.0], ""),
                ([3.0, 1.0], ""),
                ([2.1, -0.1], "outside"),
                ([9.0, 1.0], "outside"),
            ],
        ),
        (
            "a partition from wall to wall",
            vec![room(), single("p", [2.0, 0.0], [2.0, 3.0])],
            &[([1.0, 1.0], ""), ([3.0, 1.0], ""), ([9.0, 1.0], "outside")],
        ),
        (
            "a box against the wall",
            vec![room(), ring("P", [0.0, 1.0], [0.5, 0.5])],
            &[([1.0, 1.0], ""), ([0.2, 1.2], "inside `P`"), ([9.0, 1.0], "outside")],
        ),
        (
            "a room drawn twice",
            vec![room(), ring("again", [0.0004, 0.0], [3.9992, 3.0005])],
            &[([1.0, 1.0], ""), ([9.0, 1.0], "outside")],
        ),
        (
            "a screen in the garden",
            vec![room(), single("p", [6.0, 0.0], [6.0, 3.0])],
            &[([1.0, 1.0], ""), ([5.0, 1.0], "")],
        ),
    ];
    for (name, mut walls, places) in cases {
        for rotation in 0..2 * walls.len() {
            walls.rotate_left(1);
            if rotation == walls.len() {
                walls.reverse();
            }
            let texts: Vec<&str> = walls.iter().map(String::as_str).collect();
            let scene = scene_with_walls(&texts, "");
            for (at, expected) in places {
                let found = rejection(&scene, *at);
                let fits =
                    if expected.is_empty() { found.is_empty() } else { found.contains(expected) };
                assert!(fits, "{name}, {rotation}: {at:?} is `{found}`, not `{expected}`");
            }
        }
    }
}

/// A large body differs from a second room by the larger outline around it, whatever the direction
/// of its walls.
#[test]
fn outline_direction_is_irrelevant() {
    let ring = |id: &str, corners: &str| {
        let m = r#""closed": true, "material": "m""#;
        format!(r#"{{"id": "{id}", "polyline": [{corners}], {m}}}"#)
    };
    let rooms = ["[0,0],[4,0],[4,3],[0,3]", "[0,3],[4,3],[4,0],[0,0]"];
    let bodies =
        ["[0.7,0.5],[3.5,0.5],[3.5,2.5],[0.7,2.5]", "[0.7,2.5],[3.5,2.5],[3.5,0.5],[0.7,0.5]"];
    let at = |x_m: f64, y_m: f64| Pose { x_m, y_m, heading_deg: 0.0 };
    for room in rooms {
        for body in bodies {
            let scene = scene_with_walls(&[&ring("R", room), &ring("B", body)], "");
            assert_eq!(scene.check_pose(&at(0.3, 0.3)), Ok(()), "{room} {body}");
            let inside = scene.check_pose(&at(2.0, 1.5));
            assert!(
                matches!(inside, Err(PoseError::InsideBody { .. })),
                "{room} {body}: {inside:?}"
            );
            let outside = scene.check_pose(&at(5.0, 1.0));
            assert!(matches!(outside, Err(PoseError::OutsideRoom { .. })), "{room} {body}");
        }
    }
}
