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

/// Replaces `part` of the good scene by `bad` and expects an error that points at the text
/// `points_at`, starts with `expect` (path and message) and whose help contains `help`.
#[track_caller]
fn check(part: &str, bad: &str, points_at: &str, expect: &str, help: &str) {
    assert_eq!(GOOD.matches(part).count(), 1, "`{part}` must stand there once");
    let text = GOOD.replace(part, bad);
    let error = Scene::from_json(&text).expect_err(expect);
    assert_eq!(&text[error.span.clone()], points_at, "{error}");
    let place = format!("{}:{}: ", error.line, error.column);
    let (line, column) = (error.line - 1, error.column - 1);
    let from_there: String =
        text.lines().nth(line).into_iter().flat_map(|l| l.chars().skip(column)).collect();
    let first_line = points_at.lines().next().unwrap_or_default();
    assert!(from_there.starts_with(first_line), "{error}");
    let shown = error.to_string();
    let shown = shown.strip_prefix(&place).expect("line and column come first");
    assert!(shown.starts_with(expect), "got `{shown}`, expected `{expect}`");
    assert!(error.help().contains(help), "help `{}` lacks `{help}`", error.help());
}

#[test]
fn a_scene_is_read_with_its_polylines_cut_into_segments() {
    let scene = good();
    let ids: Vec<&str> = scene.walls.iter().map(|wall| &*wall.id).collect();
    assert_eq!(ids, ["south", "rest.0", "rest.1", "rest.2", "pillar.0", "pillar.1", "pillar.2"]);
    let closing = &scene.walls[6];
    assert_eq!((closing.a, closing.b), (DVec2::new(2.0, 2.0), DVec2::new(1.0, 1.0)));
    assert_eq!(closing.z_m, Some([0.0, 1.0]));
    assert_eq!(scene.walls[0].material, Material { reflectance: 0.9, roughness: 0.0 });
    assert_eq!((scene.floor_z_m, scene.ceiling_z_m), (Some(0.0), Some(2.5)));
    assert_eq!([scene.floor_material, scene.ceiling_material], [Material::RIGID; 2]);
    let with_carpet =
        GOOD.replace(r#""floor_z_m": 0,"#, r#""floor_z_m": 0, "floor_material": "board","#);
    let carpeted = Scene::from_json(&with_carpet).expect("a floor of board");
    assert_eq!(carpeted.floor_material, scene.walls[0].material);
    assert_eq!(scene.poses["desk"], Pose { x_m: 3.5, y_m: 0.5, heading_deg: 0.0 });
}

#[test]
fn sha256_is_that_of_the_text() {
    // printf '%s' '{"name":"e","materials":{}}' | sha256sum
    let scene = Scene::from_json(r#"{"name":"e","materials":{}}"#).expect("an empty scene");
    assert_eq!(scene.sha256, "4b036c0d60e29f6609387a558642084f9bd0fddd5152a8e4531910d7c7c2b4d2");
}

#[test]
fn line_and_column_count_from_one_and_in_characters() {
    let error =
        Scene::from_json("{\n  \"name\": \"\u{e9}\u{e9}\", \"nam\": 3}").expect_err("no field");
    assert_eq!((error.line, error.column, error.path.as_str()), (2, 17, "nam"));
}

#[test]
#[rustfmt::skip]
fn syntax_errors_point_at_the_place() {
    check(r#"[4, 0], "material""#, r#"[4, 0, "material""#, ":", "this is not JSON: expected `,` or `]`", "brackets");
    check("0.5}}\n}", "0.5", "{", "this `{` is never closed", "`}`");
    check("[0, 0]]", "[0, 0]", ":", "this is not JSON: expected `,` or `]` (the `[` at 6:32 is still open)", "brackets");
    check(r#"[0, 0], "to""#, r#"[NaN, 0], "to""#, "N", "this is not JSON: expected value", "no NaN");
    check(r#"[0, 0], "to""#, r#"[1e999, 0], "to""#, "9", "this is not JSON: number out of range", "finite");
    check(r#""t","#, r#""t", // comment"#, "/", "this is not JSON: key must be a string", "");
    let deep = GOOD.replace("\"t\"", &"[".repeat(100_000));
    let error = Scene::from_json(&deep).expect_err("too deep");
    assert!(error.message().contains("recursion limit"), "{error}");
    let empty = Scene::from_json("").expect_err("empty");
    assert_eq!((empty.line, empty.column), (1, 1));
}

#[test]
#[rustfmt::skip]
fn shapes_that_do_not_fit_are_named() {
    check(r#""floor_z_m""#, r#""flor_z_m""#, r#""flor_z_m""#, "flor_z_m: unknown field `flor_z_m`", "did you mean `floor_z_m`?");
    check(r#""closed""#, r#""close""#, r#""close""#, "walls[2].close: unknown field `close`", "did you mean `closed`?");
    check("0.9", r#""0.9""#, r#""0.9""#, "materials.board.reflectance: found string \"0.9\", expected a number", "quotes");
    check("true", "1", "1", "walls[2].closed: found integer `1`, expected a boolean", "");
    check(r#""center": [3, 2], "#, "", r#"{"id": "leg", "radius_m": 0.1, "material": "board"}"#, "cylinders[0]: the field `center` is missing", "\"center\"");
    check(r#"[4, 0], "m"#, r#"[4, 0, 1], "m"#, "[4, 0, 1]", "walls[0].to: invalid length 3, expected", "");
    check(r#"[4, 0], "m"#, r#"[4], "m"#, "[4]", "walls[0].to: invalid length 1, expected", "");
    check(r#"{"x_m": 3.5, "y_m": 0.5}"#, "[3.5, 0.5, 0]", "[3.5, 0.5, 0]", "poses.desk: found an array where an object", "");
    check(r#"{"reflectance": 0.9}"#, "[0.9, 0.1]", "[0.9, 0.1]", "materials.board: found an array", "");
    check(r#""desk""#, r#""door""#, r#""door""#, "poses.door: `door` is given twice", "one of the two");
    let array = Scene::from_json("[1]").expect_err("an array");
    assert!(array.to_string().starts_with("1:1: found an array"), "{array}");
}

#[test]
#[rustfmt::skip]
fn rules_of_scenes_are_kept() {
    check(r#""leg""#, r#""south""#, r#""south""#, "cylinders[0].id: the id `south` is already the name of walls[0]", "own");
    check(r#""leg""#, r#""rest.1""#, r#""rest.1""#, "cylinders[0].id: the id `rest.1` is already the name of walls[1]", "");
    check(r#""leg""#, r#"" ""#, r#"" ""#, "cylinders[0].id: this name is empty", "");
    check(r#"0.1, "material": "board""#, r#"0.1, "material": "bord""#, r#""bord""#, "cylinders[0].material: there is no material `bord`", "did you mean `board`?");
    check(r#""to": [4, 0]"#, r#""to": [0, 0]"#, "[0, 0]", "walls[0].to: this wall has no length", "0.1 mm");
    check("[2, 1], [2, 2]]", "[2, 1], [2, 1]]", "[2, 1]", "walls[2].polyline[2]: this wall has no length", "");
    check("[2, 1], [2, 2]]", "[2, 1], [1, 1]]", "[1, 1]", "walls[2].polyline[2]: this wall has no length", "does not repeat");
    check("[[1, 1], [2, 1], [2, 2]]", "[[1, 1], [2, 1]]", "[[1, 1], [2, 1]]", "walls[2].polyline: 2 points are too few", "3");
    check(r#""to": [4, 0], "#, "", r#"{"id": "south", "from": [0, 0], "material": "board"}"#, "walls[0]: the field `to` is missing", "");
    check(r#""to": [4, 0], "#, r#""to": [4, 0], "closed": true, "#, "true", "walls[0].closed: only a polyline", "");
    check(r#""from": [0, 0], "to": [4, 0], "#, "", r#"{"id": "south", "material": "board"}"#, "walls[0]: this wall has neither", "\"polyline\"");
    check("[4, 3]", "[4, 3000]", "3000", "walls[1].polyline[1][1]: 3000 m is out of bounds", "millimetres");
    check("0.1", "-0.1", "-0.1", "cylinders[0].radius_m: a radius of -0.1 m", "greater than 0");
    check("0.9", "1.2", "1.2", "materials.board.reflectance: reflectance is 1.2", "0 to 1");
    check(r#""ceiling_z_m": 2.5"#, r#""ceiling_material": "board""#, r#""board""#, "ceiling_material: there is none", "give its height as `ceiling_z_m`");
    check(r#""floor_z_m": 0"#, r#""floor_z_m": 0, "floor_material": "bord""#, r#""bord""#, "floor_material: there is no material `bord`", "did you mean `board`?");
    check(r#""ceiling_z_m": 2.5"#, r#""ceiling_z_m": -1"#, "-1", "ceiling_z_m: ceiling_z_m (-1 m) is not above floor_z_m (0 m)", "");
    check("[0, 1]", "[1, 0]", "[1, 0]", "walls[2].z_m: the upper height (0 m) is not above", "lower height first");
    check(r#""desk""#, r#""a,b""#, r#""a,b""#, "poses.a,b: the pose name", "comma");
    check(r#"{"x_m": 3.5, "y_m": 0.5}"#, r#"{"x_m": 4.5, "y_m": 0.5}"#, r#"{"x_m": 4.5, "y_m": 0.5}"#, "poses.desk: the pose (4.5, 0.5) m is outside the room", "x 0 to 4 m and y 0 to 3 m");
    check(r#""heading_deg": 90"#, r#""heading_deg": 900"#, "900", "poses.door.heading_deg: a heading of 900", "360");
}

#[test]
fn a_robot_has_one_shape_and_leaves_the_ranger_outside() {
    let robot = |shape: &str| {
        let member = format!(
            "\"robot\": {{\"id\": \"b12\", \"material\": \"board\", {shape}}}, \"floor_z_m\""
        );
        Scene::from_json(&GOOD.replace("\"floor_z_m\"", &member))
    };
    let round =
        robot(r#""circle": {"center": [-0.16, 0], "radius_m": 0.15}"#).expect("a round one");
    // Heading 90 degrees at (0.5, 0.5): 0.16 m behind is 0.16 m below.
    let with_body = round.with_robot_at(&round.poses["door"]);
    let body = with_body.cylinders.last().expect("the body");
    assert!((body.center - DVec2::new(0.5, 0.34)).length() < 1e-12, "{body:?}");
    assert_eq!(&*body.id, "b12");

    let flat = robot(r#""outline": [[-0.1, 0.1], [-0.3, 0.1], [-0.3, -0.1], [-0.1, -0.1]]"#)
        .expect("a flat one");
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
            "the body `b12` runs into `south`",
        ),
        (
            r#""outline": [[-0.1, 0.1], [-0.7, 0.1], [-0.1, -0.1]]"#,
            "the body `b12` runs into `south`",
        ),
    ] {
        let error = robot(shape).expect_err(problem).to_string();
        assert!(error.contains(problem), "{shape}: {error}");
    }
}

#[test]
fn poses_are_named_or_in_numbers() {
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
fn a_ranger_stands_only_where_there_is_air() {
    let scene = good();
    let refusal = |x_m: f64, y_m: f64| {
        scene.check_pose(&Pose { x_m, y_m, heading_deg: 0.0 }).err().map(|error| error.to_string())
    };
    assert_eq!(refusal(0.5, 0.5), None);
    // In the corner of the pillar's box, but not in its triangle.
    assert_eq!(refusal(1.2, 1.8), None);
    for (x_m, y_m, message) in [
        (-1.0, 1.0, "outside the room"),
        (1.8, 1.2, "inside `pillar`"),
        (3.0, 2.05, "inside `leg`"),
        (2.0, 0.0005, "0.50 mm from `south`"),
        (3.0, 2.1005, "0.50 mm from `leg`"),
        (f64::NAN, 1.0, ""),
    ] {
        let found = refusal(x_m, y_m).unwrap_or_default();
        assert!(!found.is_empty() && found.contains(message), "({x_m}, {y_m}): {found}");
    }
}

#[test]
fn a_lone_ring_is_a_room_unless_the_poses_stand_outside() {
    let lone = |pose: &str| {
        Scene::from_json(&format!(
            r#"{{"name": "lone", "materials": {{"m": {{"reflectance": 1}}}},
               "walls": [{{"id": "ring", "polyline": [[0,0],[1,0],[1,1],[0,1]], "closed": true, "material": "m"}}],
               "poses": {{{pose}}}}}"#
        ))
        .expect("a lone ring")
    };
    let (inside, outside) = (
        Pose { x_m: 0.5, y_m: 0.5, heading_deg: 0.0 },
        Pose { x_m: 2.0, y_m: 0.5, heading_deg: 0.0 },
    );
    let room = lone("");
    assert_eq!(room.check_pose(&inside), Ok(()));
    assert!(matches!(room.check_pose(&outside), Err(PoseError::OutsideRoom { .. })));
    let body = lone(r#""p": {"x_m": 3, "y_m": 3}"#);
    assert!(matches!(body.check_pose(&inside), Err(PoseError::InsideBody { .. })));
    assert_eq!(body.check_pose(&outside), Ok(()));
}

#[test]
fn walls_that_do_not_close_enclose_nothing() {
    let open = GOOD.replace(", [0, 0]], \"material\"", "], \"material\"");
    let scene = Scene::from_json(&open).expect("an open room");
    let outside = Pose { x_m: -1.0, y_m: 1.0, heading_deg: 0.0 };
    assert_eq!(scene.check_pose(&outside), Ok(()));
    for pose in [Pose { x_m: f64::NAN, ..outside }, Pose { heading_deg: f64::INFINITY, ..outside }]
    {
        assert!(matches!(scene.check_pose(&pose), Err(PoseError::BadNumber { .. })), "{pose:?}");
    }
}

#[test]
fn a_byte_order_mark_is_let_pass() {
    let marked = format!("\u{feff}{GOOD}");
    assert_eq!(Scene::from_json(&marked).expect("with a mark").walls, good().walls);
    let wrong = marked.replace("\"closed\"", "\"close\"");
    let error = Scene::from_json(&wrong).expect_err("a wrong field");
    assert_eq!(&wrong[error.span.clone()], "\"close\"");
}

#[test]
fn no_text_of_a_scene_reaches_a_terminal_as_a_command_or_without_end() {
    for (name, text) in [
        ("an id", GOOD.replace("\"leg\"", r#""\u001b[2Jleg""#)),
        ("a pose", GOOD.replace("\"desk\"", r#""de\u0007sk""#)),
        ("a material", GOOD.replace("\"board\"", r#""bo\nard""#)),
        ("a field", GOOD.replace("\"closed\"", r#""clo\u001bsed""#)),
        ("a long field", GOOD.replace("closed", &"x".repeat(1 << 20))),
        (
            "a long material",
            GOOD.replacen(
                "\"material\": \"board\"",
                &format!("\"material\": \"{}\"", "y".repeat(1 << 20)),
                1,
            ),
        ),
        ("a long value", GOOD.replace("true", &format!("\"{}\"", "z".repeat(1 << 20)))),
        ("a long key twice", {
            let key = "k".repeat(1 << 20);
            format!(r#"{{"{key}": 1, "{key}": 1}}"#)
        }),
    ] {
        let error = Scene::from_json(&text).expect_err(name);
        for said in [error.to_string(), error.help()] {
            assert!(said.len() < 4000, "{name}: {} characters", said.len());
            assert!(!said.contains(char::is_control), "{name}: {said:?}");
        }
    }
}

/// A scene of walls and what `more` says.
fn plan_of(walls: &[&str], more: &str) -> Scene {
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

fn single(id: &str, from: [f64; 2], to: [f64; 2]) -> String {
    format!(r#"{{"id": "{id}", "from": {from:?}, "to": {to:?}, "material": "m"}}"#)
}

#[test]
fn where_a_ranger_can_stand_follows_from_the_plan_alone() {
    let refusal = |scene: &Scene, [x_m, y_m]: [f64; 2]| {
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
        for turn in 0..2 * walls.len() {
            walls.rotate_left(1);
            if turn == walls.len() {
                walls.reverse();
            }
            let texts: Vec<&str> = walls.iter().map(String::as_str).collect();
            let scene = plan_of(&texts, "");
            for (at, expected) in places {
                let found = refusal(&scene, *at);
                let fits =
                    if expected.is_empty() { found.is_empty() } else { found.contains(expected) };
                assert!(fits, "{name}, {turn}: {at:?} is `{found}`, not `{expected}`");
            }
        }
    }
}

#[test]
fn shipped_scenes_pass_their_check() {
    for (name, text) in shipped::SCENES {
        let scene = Scene::from_json(text).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(scene.name, *name);
        assert!(scene.source.is_some(), "{name} names no source");
        assert!(!scene.approximate.is_empty(), "{name} does not say what is approximate");
        assert!(!scene.poses.is_empty(), "{name} has no pose");
    }
}

#[test]
fn the_committed_schema_is_current() {
    let current = format!("{:#}\n", json_schema());
    let committed = include_str!("../../../../scenes/scene.schema.json");
    assert!(current == committed, "write it again: sonard scene schema > scenes/scene.schema.json");
}

#[test]
fn each_scene_file_is_shipped_under_its_name() {
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
