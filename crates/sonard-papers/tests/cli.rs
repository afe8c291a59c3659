//! Runs of the program `sonard-papers`.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use serde_json::Value;
use sonard_interpret::interpret::lines::LaserScan;
use tempfile::TempDir;

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sonard-papers"))
        .args(arguments)
        .output()
        .expect("the program starts")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Room of 4 m by 3.2 m with free floor around a pillar.
const ROOM: &str = r#"{"name":"gallery","materials":{"m":{"reflectance":0.95}},"walls":[
    {"id":"room","polyline":[[0,0],[4,0],[4,3.2],[0,3.2]],"closed":true,"material":"m"},
    {"id":"pillar","polyline":[[1.8,1.4],[2.2,1.4],[2.2,1.8],[1.8,1.8]],"closed":true,"material":"m"}],
    "poses":{"start":{"x_m":0.8,"y_m":0.8,"heading_deg":0}}}"#;

fn json_lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).expect("a record")).collect()
}

#[test]
fn exploration_writes_its_files() {
    let folder = TempDir::new().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("plain path").to_owned();
    let (room, out) = (path("room.json"), path("out"));
    fs::write(&room, ROOM).expect("written");
    let arguments =
        ["explore", "--scene", &room, "--pose", "start", "--sonar-range", "3.5", "--json"];
    let output = run(&[&arguments[..], &["--sensing", "just-in-time", "--out", &out]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let [object] = json_lines(&String::from_utf8_lossy(&output.stdout)).try_into().expect("one");
    let number = |name: &str| object[name].as_f64().unwrap_or_else(|| panic!("{name}: {object}"));
    assert_eq!(object["sensing"], "just-in-time");
    assert_eq!((object["finished"].as_bool(), number("collisions")), (Some(true), 0.0));
    assert!(number("travel_m") > 5.0 && number("laser_shots") >= 4.0, "{object}");
    for error in ["map_error_m", "line_error_m", "endpoint_error_m"] {
        assert!(number(error) < 0.03, "{error}: {object}");
    }
    let read = |name: &str| fs::read(folder.path().join("out").join(name)).expect(name);
    let lines = json_lines(&String::from_utf8_lossy(&read("lines.jsonl")));
    assert_eq!(lines.len() as f64, number("lines"));
    assert_eq!(&read("exploration.apng")[..4], b"\x89PNG");
    assert!(read("exploration.apng").windows(4).any(|bytes| bytes == b"acTL"), "animated");
    assert_eq!(&read("stage-2.png")[..4], b"\x89PNG");
    assert!(read("exploration.svg").starts_with(b"<svg"));

    // Laser scans, the input of `sonard lines --laser`.
    let laser = String::from_utf8(read("laser.jsonl")).expect("text");
    let scans: Vec<LaserScan> = laser
        .lines()
        .map(|line| serde_json::from_str(line).expect("a scan of the laser"))
        .collect();
    assert!(scans.iter().any(|scan| scan.returns.iter().any(|reading| reading.range_m.is_some())));
}

#[test]
fn exploration_depends_on_the_seed() {
    let explore = |seed: &str| {
        let scene = ["explore", "--scene", "two-surface-room", "--pose", "middle", "--json"];
        let further = ["--sonar-range", "3.2", "--sensing", "laser", "--odometry-noise", "0.01"];
        let output = run(&[&scene[..], &further, &["--seed", seed]].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        output.stdout
    };
    assert_eq!(explore("3"), explore("3"));
    assert_ne!(explore("3"), explore("4"));
}

#[test]
fn explore_table_has_every_room() {
    let arguments =
        ["benchmark", "explore", "--rooms", "2", "--sonar-range", "3.2", "--max-stops", "60"];
    let output = run(&arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    for words in ["sonar", "laser", "just-in-time", "incomplete", "all"] {
        assert!(table.contains(words), "{words}: {table}");
    }
    let output = run(&[&arguments[..], &["--json"]].concat());
    let rows = json_lines(&String::from_utf8_lossy(&output.stdout));
    assert_eq!(rows.len(), 6);
    assert!(rows.iter().all(|row| row["map_error_m"].is_f64() && row["room"].is_u64()), "{rows:?}");
}

#[test]
fn views_table_compares_the_maps_of_a_room() {
    let arguments = ["benchmark", "views", "--kinds", "rectangle", "--rooms", "1"];
    let further = ["--max-views", "4", "--max-stops", "8", "--odometry", "0.02,2"];
    let output = run(&[&arguments[..], &further, &["--json"]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let rows = json_lines(&String::from_utf8_lossy(&output.stdout));
    let methods: Vec<&str> = rows.iter().filter_map(|row| row["method"].as_str()).collect();
    let all = ["next-views", "sonar-lines", "just-in-time-lines"];
    assert_eq!(methods, [all, all].concat());
    for (row, odometry) in
        rows.iter().zip([[0.0; 2], [0.02, 2.0]].into_iter().flat_map(|of| [of; 3]))
    {
        assert_eq!(row["odometry_per_m"], serde_json::json!(odometry), "{row}");
        let share = |within: &str, of: &str| row[within][of].as_f64().expect("a share");
        for of in ["recall", "precision"] {
            assert!(share("within_10_cm", of) >= share("within_2_cm", of), "{row}");
        }
        if row["method"] == "next-views" {
            assert_eq!(row["finished"], true, "{row}");
            assert!(share("within_2_cm", "recall") > 0.995, "{row}");
            assert!(row["stops"].as_u64() <= Some(4), "{row}");
        }
    }
}

#[test]
fn wrong_input_names_the_valid_range() {
    let scene = ["explore", "--scene", "simple-room"];
    for (further, words) in [
        (&["--pose", "fig9"][..], "farther from it"),
        (&["--pose", "0.464,0.371,0", "--standoff", "0"][..], "from 0.4 to 3"),
        (&["--pose", "0.464,0.371,0", "--odometry-noise", "2"][..], "from 0 to 1"),
        (&["--pose", "0.464,0.371,0", "--logical", "0"][..], "from 0.5 to 20"),
        (&["--pose", "nowhere"][..], "fig9"),
    ] {
        let output = run(&[&scene[..], further].concat());
        assert_eq!(output.status.code(), Some(2), "{further:?}: {}", stderr(&output));
        assert!(stderr(&output).replace('\n', " ").contains(words), "{words}: {}", stderr(&output));
    }
    for (further, words) in [
        (["--odometry", "0.3,5"], "from 0 to 0.2"),
        (["--odometry", "0.1"], "use M,DEG"),
        (["--kinds", "round"], "rectangle, oblique"),
        (["--max-views", "1"], "2..=40"),
    ] {
        let output = run(&[&["benchmark", "views"][..], &further].concat());
        assert_eq!(output.status.code(), Some(2), "{further:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(words), "{words}: {}", stderr(&output));
    }
}

#[test]
fn map_table_is_reproducible() {
    let arguments = ["benchmark", "map", "--maps", "3", "--places", "8", "--seed", "7"];
    let [first, second] = [run(&arguments), run(&arguments)];
    assert!(first.status.success(), "{}", stderr(&first));
    assert_eq!(first.stdout, second.stdout);
    assert!(String::from_utf8_lossy(&first.stdout).contains("mcgill-lab"));
    let none = run(&["benchmark", "map", "--places", "0"]);
    assert_eq!(none.status.code(), Some(2));
    assert!(stderr(&none).contains("1..=100000"), "{}", stderr(&none));
}

#[test]
fn reliability_has_a_picture() {
    let folder = TempDir::new().expect("a temporary folder");
    let picture = folder.path().join("reliability.svg");
    let output = run(&["benchmark", "interpret", "--trials", "2", "-o", path_text(&picture)]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(String::from_utf8_lossy(&output.stdout).contains("expected calibration error"));
    assert!(fs::read(&picture).expect("written").starts_with(b"<svg"));
}

fn path_text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// Writes a map of unknown cells over `simple-room`.
fn write_map(folder: &Path) {
    fs::create_dir_all(folder).expect("a folder");
    let mut pgm = b"P5\n40 40\n255\n".to_vec();
    pgm.extend([205; 1600]);
    fs::write(folder.join("map.pgm"), pgm).expect("written");
    let yaml = "image: map.pgm\nresolution: 0.05\norigin: [-0.5, -0.5, 0.0]\nnegate: 0\n\
                occupied_thresh: 0.65\nfree_thresh: 0.196\n";
    fs::write(folder.join("map.yaml"), yaml).expect("written");
}

#[test]
fn ideal_map_has_a_perfect_score() {
    let folder = TempDir::new().expect("a temporary folder");
    let [map, ideal] = ["map", "ideal"].map(|name| folder.path().join(name));
    write_map(&map);
    let (map, ideal) = (path_text(&map), path_text(&ideal));
    let output = run(&["benchmark", "score", map, "simple-room", "--save-ideal", ideal]);
    assert!(output.status.success(), "{}", stderr(&output));
    let output = run(&["benchmark", "score", ideal, "simple-room", "--json"]);
    let score: Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(score["map_score_percent"].as_f64(), Some(0.0), "{score}");
    for (arguments, words) in [
        (["nowhere", "simple-room", "--spacing", "1"], "map.yaml next to map.pgm"),
        ([map, "simple-rom", "--spacing", "1"], "simple-room"),
        ([map, "simple-room", "--spacing", "0"], "greater than 0"),
    ] {
        let output = run(&[&["benchmark", "score"], &arguments[..]].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).contains(words), "{words}: {}", stderr(&output));
    }
}

#[test]
fn inputs_are_never_replaced() {
    let folder = TempDir::new().expect("a temporary folder");
    let map = folder.path().join("map");
    write_map(&map);
    let before = fs::read(map.join("map.pgm")).expect("a file");
    let arguments = ["benchmark", "score", path_text(&map), "simple-room", "--save-ideal"];
    for further in [&[path_text(&map)][..], &[path_text(&map), "--force"]] {
        let output = run(&[&arguments[..], further].concat());
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains("is an input"), "{}", stderr(&output));
    }
    assert_eq!(fs::read(map.join("map.pgm")).expect("a file"), before);
    let picture = folder.path().join("a.svg");
    fs::write(&picture, "mine").expect("written");
    let interpret = ["benchmark", "interpret", "--trials", "1", "-o", path_text(&picture)];
    assert_eq!(run(&interpret).status.code(), Some(2));
    assert_eq!(fs::read_to_string(&picture).expect("a file"), "mine");
    assert!(run(&[&interpret[..], &["--force"]].concat()).status.success());
}
