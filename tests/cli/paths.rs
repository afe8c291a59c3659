//! `sonard paths`, as a user meets it.

use assert_cmd::Command;
use predicates::{prelude::PredicateBooleanExt, str::contains};
use serde_json::Value;

fn paths(args: &[&str]) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_sonard")).arg("paths").args(args).assert()
}

fn lines(args: &[&str]) -> Vec<Value> {
    let output = paths(args).success().get_output().stdout.clone();
    let text = String::from_utf8(output).expect("UTF-8");
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

#[test]
fn json_of_figure_9() {
    let lines = lines(&["--scene", "simple-room", "--pose", "fig9", "--max-range", "1", "--json"]);
    let length = |line: &Value| line["length_m"].as_f64().expect("a number");
    assert!(lines.windows(2).all(|pair| length(&pair[0]) <= length(&pair[1])));
    let false_wall: Vec<_> =
        lines.iter().filter(|line| (length(line) - 1.654).abs() < 1e-9).collect();
    assert_eq!(false_wall.len(), 1);
    let line = false_wall[0];
    let at =
        |id: &str, y: f64| serde_json::json!({"kind": "reflection", "id": id, "point": [0.774, y]});
    let met = [at("south", 0.0), at("north", 0.742), at("south", 0.0)];
    assert_eq!(line["interactions"], serde_json::json!(met));
    assert_eq!((&line["kind"], &line["order"]), (&"specular".into(), &3.into()));
    for end in ["departure_deg", "arrival_deg"] {
        assert!((line[end].as_f64().expect("a number") - 270.0).abs() < 1e-9);
    }
    // Three reflections at 0.98 and 1.654 m of air.
    let amplitude = line["amplitude"].as_f64().expect("a number");
    assert!((amplitude - 0.98_f64.powi(3) * f64::exp(-0.189 * 1.654)).abs() < 1e-3);
}

#[test]
fn table_and_max_order() {
    paths(&["--scene", "simple-room", "--pose", "fig9", "--max-range", "1", "--max-order", "1"])
        .success()
        .stdout(contains("south").and(contains("4 paths")).and(contains("south, east").not()));
}

#[test]
fn azimuth_moves_the_transducers() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("wall.json");
    let text = r#"{"name":"wall","materials":{"brick":{"reflectance":1}},
        "walls":[{"id":"wall","from":[-9,2],"to":[9,2],"material":"brick"}]}"#;
    std::fs::write(&scene, text).expect("a file");
    let scene = scene.to_str().expect("UTF-8");
    // An hc-sr04's capsules are 26 mm apart: along the wall they face, and across it a quarter turn on.
    let shortest = |azimuth_deg: &str| {
        let here = ["--scene", scene, "--pose", "0,0,90", "--max-range", "3", "--max-order", "1"];
        let aimed = ["--sensor", "hc-sr04", "--azimuth-deg", azimuth_deg, "--json"];
        let lines = lines(&[&here[..], &aimed].concat());
        lines[0]["length_m"].as_f64().expect("a number")
    };
    for (azimuth_deg, length_m) in
        [("0", f64::hypot(4.0, 0.026)), ("180", f64::hypot(4.0, 0.026)), ("-90", 4.0)]
    {
        let off_m = shortest(azimuth_deg) - length_m;
        assert!(off_m.abs() < 1e-12, "{azimuth_deg}: {off_m}");
    }
}

#[test]
fn wrong_input() {
    paths(&["--scene", "simple-room", "--pose", "fig9", "--min-amplitude", "0"])
        .code(2)
        .stderr(contains("from 0.000001 to 1"));
    paths(&["--scene", "simple-room", "--pose", "nowhere"]).code(2).stderr(contains("fig7"));
}
