mod accessibility;
mod errors;
mod plans;

use super::*;

const GOOD: &str = r#"{
  "name": "t",
  "materials": {"board": {"reflectance": 0.9}},
  "walls": [
    {"id": "south", "from": [0, 0], "to": [4, 0], "material": "board"},
    {"id": "rest", "polyline": [[4, 0], [4, 3], [0, 3], [0, 0]], "material": "board"},
    {"id": "pillar", "polyline": [[1, 1], [2, 1], [2, 2]], "closed": true, "material": "board", "z_m": [0, 1]}
  ],
  "cylinders": [{"id": "leg", "center": [3, 2], "radius_m": 0.1, "material": "board"}],
  "floor_z_m": 0, "ceiling_z_m": 2.5,
  "poses": {"door": {"x_m": 0.5, "y_m": 0.5, "heading_deg": 90}, "desk": {"x_m": 3.5, "y_m": 0.5}}
}"#;

fn good() -> Scene {
    Scene::from_json(GOOD).expect("the good scene")
}

#[test]
fn polylines_become_segments() {
    let scene = good();
    let ids: Vec<&str> = scene.walls.iter().map(|wall| &*wall.id).collect();
    assert_eq!(ids, ["south", "rest.0", "rest.1", "rest.2", "pillar.0", "pillar.1", "pillar.2"]);
    let closing = &scene.walls[6];
    assert_eq!((closing.a, closing.b), (DVec2::new(2.0, 2.0), DVec2::new(1.0, 1.0)));
    assert_eq!(closing.z_m, Some([0.0, 1.0]));
    assert_eq!(scene.walls[0].material, Material::smooth(0.9));
    assert_eq!((scene.floor_z_m, scene.ceiling_z_m), (Some(0.0), Some(2.5)));
    assert_eq!([scene.floor_material, scene.ceiling_material], [Material::RIGID; 2]);
    let with_carpet =
        GOOD.replace(r#""floor_z_m": 0,"#, r#""floor_z_m": 0, "floor_material": "board","#);
    let carpeted = Scene::from_json(&with_carpet).expect("a floor of board");
    assert_eq!(carpeted.floor_material, scene.walls[0].material);
    assert_eq!(scene.poses["desk"], Pose { x_m: 3.5, y_m: 0.5, heading_deg: 0.0 });
}

#[test]
fn sha256_covers_the_text() {
    // printf '%s' '{"name":"e","materials":{}}' | sha256sum
    let scene = Scene::from_json(r#"{"name":"e","materials":{}}"#).expect("an empty scene");
    assert_eq!(scene.sha256, "4b036c0d60e29f6609387a558642084f9bd0fddd5152a8e4531910d7c7c2b4d2");
}

#[test]
fn robot_has_one_shape() {
    let robot = |shape: &str| {
        let member = format!(
            "\"robot\": {{\"id\": \"b12\", \"material\": \"board\", {shape}}}, \"floor_z_m\""
        );
        Scene::from_json(&GOOD.replace("\"floor_z_m\"", &member))
    };
    let round = robot(r#""circle": {"center": [-0.16, 0], "radius_m": 0.15}"#).expect("a circle");
    // Heading 90 degrees at (0.5, 0.5): 0.16 m behind is 0.16 m below.
    let with_body = round.with_robot_at(&round.poses["door"]);
    let body = with_body.cylinders.last().expect("the body");
    assert!((body.center - DVec2::new(0.5, 0.34)).length() < 1e-12, "{body:?}");
    assert_eq!(&*body.id, "b12");

    let flat = robot(r#""outline": [[-0.1, 0.1], [-0.3, 0.1], [-0.3, -0.1], [-0.1, -0.1]]"#)
        .expect("an outline");
    let with_body = flat.with_robot_at(&flat.poses["door"]);
    assert_eq!(with_body.walls.len(), flat.walls.len() + 4);
    let first = &with_body.walls[flat.walls.len()];
    assert!((first.a - DVec2::new(0.4, 0.4)).length() < 1e-12, "{first:?}");

    for (shape, problem) in [
        (r#""circle": {"center": [-0.1, 0], "radius_m": 0.15}"#, "robot.circle: the ranger"),
        (r#""outline": [[1, 1], [-1, 1], [0, -1]]"#, "robot.outline: the ranger"),
        (r#""outline": [[1, 1], [-1, 1]]"#, "robot.outline: 2 points"),
        (r#""z_m": [0, 1]"#, "robot: a robot has either"),
        (
            r#""circle": {"center": [-0.7, 0], "radius_m": 0.65}"#,
            "the body `b12` collides with `south`",
        ),
        (
            r#""outline": [[-0.1, 0.1], [-0.7, 0.1], [-0.1, -0.1]]"#,
            "the body `b12` collides with `south`",
        ),
    ] {
        let error = robot(shape).expect_err(problem).to_string();
        assert!(error.contains(problem), "{shape}: {error}");
    }
}

#[test]
fn poses_by_name_or_coordinates() {
    let scene = good();
    assert_eq!(scene.pose("door"), Ok(Pose { x_m: 0.5, y_m: 0.5, heading_deg: 90.0 }));
    assert_eq!(scene.pose(" 1 , -2.5 "), Ok(Pose { x_m: 1.0, y_m: -2.5, heading_deg: 0.0 }));
    assert_eq!(scene.pose("1,2,-45"), Ok(Pose { x_m: 1.0, y_m: 2.0, heading_deg: -45.0 }));
    for (spec, message, help) in [
        ("dor", "the scene `t` has no pose `dor`", "did you mean `door`? poses: `desk`, `door`"),
        ("zzz", "no pose `zzz`", "poses: `desk`, `door`; or give X,Y,DEG"),
        ("1,2,3,4", "`1,2,3,4` is not a pose", "X,Y,DEG"),
        ("1,b", "Y `b` is not a number", "X,Y,DEG"),
        ("nan,1", "X `nan` is not a number", ""),
        ("1,2,1e9", "DEG `1e9` is not a number from -360 to 360", ""),
        ("1,2,", "DEG `` is not a number", ""),
        ("", "no pose ``", "door"),
    ] {
        let error = scene.pose(spec).expect_err(spec);
        assert!(error.to_string().contains(message), "{spec}: {error}");
        assert!(error.help().contains(help), "{spec}: {}", error.help());
    }
}

#[test]
fn shipped_scenes_are_valid() {
    for (name, text) in shipped::SCENES {
        let scene = Scene::from_json(text).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(scene.name, *name);
        assert!(scene.source.is_some(), "{name} names no source");
        assert!(!scene.approximate.is_empty(), "{name} lists no approximations");
        assert!(!scene.poses.is_empty(), "{name} has no pose");
    }
}

#[test]
fn committed_schema_is_current() {
    let current = format!("{:#}\n", json_schema());
    let committed = include_str!("../../../../scenes/scene.schema.json");
    assert!(current == committed, "regenerate it: sonard scene schema > scenes/scene.schema.json");
}

#[test]
fn scene_files_match_shipped_names() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes");
    let mut files: Vec<String> = std::fs::read_dir(folder)
        .expect("the scenes")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|file| file != "scene.schema.json")
        .collect();
    let mut shipped: Vec<String> = shipped::names().map(|name| format!("{name}.json")).collect();
    files.sort();
    shipped.sort();
    assert_eq!(files, shipped);
}

/// A point is as far from a scene as from its nearest wall or cylinder.
#[test]
fn clearance_is_the_smallest_distance() {
    let mut scene = Scene::builder("room")
        .material("wood", 0.9)
        .walls("wall", &[[0.0, 0.0], [4.0, 0.0]], "wood")
        .build()
        .expect("a scene");
    assert_eq!(scene.clearance_m(DVec2::new(2.0, 1.5)), 1.5);
    assert_eq!(scene.clearance_m(DVec2::new(7.0, 4.0)), 5.0);
    let material = scene.walls[0].material;
    let center = DVec2::new(2.0, 3.0);
    scene.cylinders =
        vec![Cylinder { id: "post".into(), center, radius_m: 0.5, material, z_m: None }];
    assert_eq!(scene.clearance_m(DVec2::new(2.0, 2.0)), 0.5);
    assert_eq!(scene.clearance_m(DVec2::new(2.0, 1.0)), 1.0);
    assert_eq!(scene.clearance_m(center), -0.5);
    (scene.walls, scene.cylinders) = Default::default();
    assert_eq!(scene.clearance_m(center), f64::INFINITY);
}
