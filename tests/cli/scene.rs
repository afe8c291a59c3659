//! `sonard scene`, as a user meets it.

use std::{fs, path::Path};

use assert_cmd::{Command, assert::Assert};
use predicates::{prelude::PredicateBooleanExt, str::contains};
use tempfile::tempdir;

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_sonard"))
}

fn scene(args: &[&str]) -> Assert {
    program().arg("scene").args(args).assert()
}

fn written(folder: &Path, text: &str) -> String {
    let path = folder.join("room.json");
    fs::write(&path, text).expect("a scene file");
    path.to_str().expect("UTF-8").to_owned()
}

#[test]
fn check_summary() {
    scene(&["check", "simple-room"])
        .success()
        .stdout("simple-room: 4 walls, 0 cylinders, 2 poses (fig7, fig9), 0.928 x 0.742 m\n");
}

#[test]
fn check_reports_the_line() {
    let folder = tempdir().expect("a folder");
    let path = written(folder.path(), "{\"name\": \"r\",\n \"materials\": {},\n \"wals\": []}");
    scene(&["check", &path])
        .code(2)
        .stdout("")
        .stderr(contains("room.json:3:2").and(contains("did you mean `walls`?")));
    let path = written(folder.path(), "{\"name\": \"r\",\n \"materials\": {\"a\": {");
    scene(&["check", &path])
        .code(2)
        .stderr(contains("room.json:2:21").and(contains("never closed")));
}

#[test]
fn check_lists_plan_changes() {
    let folder = tempdir().expect("a folder");
    let wall = |id: &str, ends: [[f64; 2]; 2]| serde_json::json!({"id": id, "from": ends[0], "to": ends[1], "material": "m"});
    let walls = [
        wall("south", [[0.0, 0.0], [4.0, 0.0]]),
        wall("east", [[4.0, 0.0005], [4.0, 3.0]]),
        wall("screen", [[2.0, 0.001], [2.0, 1.0]]),
        wall("rail", [[1.0, -0.0012], [1.0, 1.0]]),
        wall("again", [[3.0, 0.0], [3.5, 0.0]]),
    ];
    let mut scene_file = serde_json::json!(
        {"name": "r", "materials": {"m": {"reflectance": 0.9}}, "walls": walls, "poses": {}}
    );
    let path = written(folder.path(), &scene_file.to_string());
    scene(&["check", &path]).success().stdout(
        contains("r: 5 walls")
            .and(contains("east.a at (4.0000, 0.0005): moved by 0.500 mm, 0.500 mm from south.b"))
            .and(contains("screen.a at (2.0000, 0.0010): moved by 1.000 mm, short of south"))
            .and(contains("rail.a at (1.0000, -0.0012): moved by 1.200 mm, past south"))
            .and(contains("again overlaps south over 0.500 m: south is used")),
    );
    let drawn = |path: &str| {
        let out = scene(&["draw", path]).success().get_output().stdout.clone();
        String::from_utf8(out).expect("SVG")
    };
    let snapped = drawn(&path);
    scene_file["snap_m"] = serde_json::json!(0);
    let path = written(folder.path(), &scene_file.to_string());
    scene(&["check", &path])
        .success()
        .stdout(contains("\n").count(2).and(contains("again overlaps")));
    assert_ne!(drawn(&path), snapped);
    scene_file["snap_m"] = serde_json::json!(0.1);
    let path = written(folder.path(), &scene_file.to_string());
    scene(&["check", &path]).code(2).stderr(contains("snap_m is 0.1").and(contains("0.005")));
}

#[test]
fn error_in_a_very_long_line() {
    let folder = tempdir().expect("a folder");
    let walls = "[1,".repeat(1_000_000);
    let path = written(folder.path(), &format!("{{\"name\": \"r\", \"walls\": [1 2{walls}"));
    let refused = scene(&["check", &path]).code(2);
    let message = &refused.get_output().stderr;
    assert!(message.len() < 5000, "{} bytes", message.len());
    assert!(String::from_utf8_lossy(message).contains("room.json:1:"));
}

#[test]
fn transducer_below_the_floor() {
    let folder = tempdir().expect("a folder");
    let room = r#"{"name": "r", "materials": {}, "floor_z_m": 0, "ceiling_z_m": 2.5}"#;
    let path = written(folder.path(), room);
    for verb in ["simulate", "paths"] {
        let refused = program()
            .args([verb, "--scene", &path, "--pose", "0,0,0", "--sensor-z", "-0.2"])
            .assert();
        refused.code(2).stderr(contains("outside the scene's floor at 0 m"));
    }
}

#[test]
fn pose_outside_the_room() {
    scene(&["check", "simple-room", "--pose", "2,0.3"])
        .code(2)
        .stderr(contains("outside the room").and(contains("x 0 to 0.928 m")));
    scene(&["check", "simple-room", "--pose", "fig8"]).code(2).stderr(contains("did you mean"));
    scene(&["check", "simple-room", "--pose", "-0.1,0.3,-90"]).code(2);
    scene(&["check", "simple-room", "--pose", "0.1,0.3,-90"]).success();
}

#[test]
fn missing_scene() {
    scene(&["check", "simple-rom"]).code(2).stderr(contains("did you mean `simple-room`?"));
    let folder = tempdir().expect("a folder");
    scene(&["check", folder.path().to_str().expect("UTF-8")]).code(2);
    let binary = folder.path().join("binary");
    fs::write(&binary, [0xff, 0xfe]).expect("a file");
    scene(&["check", binary.to_str().expect("UTF-8")]).code(2).stderr(contains("not UTF-8"));
}

#[test]
fn file_precedes_shipped_scene() {
    let folder = tempdir().expect("a folder");
    fs::write(folder.path().join("simple-room"), r#"{"name": "mine", "materials": {}}"#)
        .expect("a scene file");
    program()
        .current_dir(folder.path())
        .args(["scene", "check", "simple-room"])
        .assert()
        .success()
        .stdout(contains("mine: 0 walls"));
}

#[test]
fn draw_svg_and_png() {
    let folder = tempdir().expect("a folder");
    let svg = folder.path().join("room.svg");
    let png = folder.path().join("room.png");
    scene(&["draw", "simple-room-robot", "-o", svg.to_str().expect("UTF-8")]).success();
    let text = fs::read_to_string(svg).expect("an SVG");
    for part in ["<svg", "south", "b12", "fig9", "Dudek"] {
        assert!(text.contains(part), "the picture lacks {part}");
    }
    scene(&["draw", "simple-room", "--pose", "fig7", "-o", png.to_str().expect("UTF-8")]).success();
    assert!(fs::read(&png).expect("a PNG").starts_with(b"\x89PNG"));
    let shown = scene(&["draw", "simple-room", "--pose", "fig7"]).success();
    shown.stdout(contains("</svg>").and(contains("fig7")).and(contains("fig9").not()));
    scene(&["draw", "simple-room", "-o", "room.gif"]).code(2).stderr(contains(".svg or .png"));
    scene(&["draw", "simple-room", "-o", "no/such/folder/room.svg"])
        .code(2)
        .stderr(contains("folder that exists"));
}

#[test]
fn schema_is_committed() {
    scene(&["schema"]).success().stdout(include_str!("../../scenes/scene.schema.json"));
}

#[test]
fn list() {
    let shown = scene(&["list"]).success().get_output().stdout.clone();
    let shown = String::from_utf8(shown).expect("UTF-8");
    for name in sonard::scene::shipped::names() {
        assert!(shown.contains(name), "{name} is not listed");
    }
}
