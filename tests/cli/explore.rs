//! `sonard explore` and its benchmark as a user runs them.

use std::fs;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{run, stderr};

/// A room of 4 m by 3.2 m with a way round a pillar.
const ROOM: &str = r#"{"name":"gallery","materials":{"m":{"reflectance":0.95}},"walls":[
    {"id":"room","polyline":[[0,0],[4,0],[4,3.2],[0,3.2]],"closed":true,"material":"m"},
    {"id":"pillar","polyline":[[1.8,1.4],[2.2,1.4],[2.2,1.8],[1.8,1.8]],"closed":true,"material":"m"}],
    "poses":{"start":{"x_m":0.8,"y_m":0.8,"heading_deg":0}}}"#;

fn json_lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).expect("a record")).collect()
}

#[test]
fn a_room_is_explored_and_what_was_seen_can_be_mapped_again() {
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
    assert_eq!((object["finished"].as_bool(), number("bumps")), (Some(true), 0.0));
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

    // The laser's file is what `sonard lines` reads.
    let (laser, picture) = (path("out/laser.jsonl"), path("laser.svg"));
    let output = run(&["lines", "--laser", &laser, "--json", "-o", &picture]);
    assert!(output.status.success(), "{}", stderr(&output));
    let again = json_lines(&String::from_utf8_lossy(&output.stdout));
    assert!(again.iter().all(|line| line["kind"] == "laser"), "{again:?}");
    let ends = again.iter().flat_map(|line| [&line["terminal"][0], &line["terminal"][1]]);
    assert!(ends.filter(|end| end.as_bool() == Some(true)).count() >= 8, "{again:?}");
}

#[test]
fn the_same_seed_gives_the_same_exploration() {
    let of = |seed: &str| {
        let scene = ["explore", "--scene", "two-surface-room", "--pose", "middle", "--json"];
        let further = ["--sonar-range", "3.2", "--sensing", "laser", "--odometry-noise", "0.01"];
        let output = run(&[&scene[..], &further, &["--seed", seed]].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        output.stdout
    };
    assert_eq!(of("3"), of("3"));
    assert_ne!(of("3"), of("4"));
}

#[test]
fn the_benchmark_has_every_room_in_its_table() {
    let arguments =
        ["benchmark", "explore", "--rooms", "2", "--sonar-range", "3.2", "--most-stops", "60"];
    let output = run(&arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    for words in ["sonar", "laser", "just-in-time", "not finished", "all"] {
        assert!(table.contains(words), "{words}: {table}");
    }
    let output = run(&[&arguments[..], &["--json"]].concat());
    let rows = json_lines(&String::from_utf8_lossy(&output.stdout));
    assert_eq!(rows.len(), 6);
    assert!(rows.iter().all(|row| row["map_error_m"].is_f64() && row["room"].is_u64()), "{rows:?}");
}

#[test]
fn wrong_input_is_refused_with_what_would_be_right() {
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
}
