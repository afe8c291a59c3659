//! `sonard map` and `sonard lines`.

use std::{fs, path::Path};

use serde_json::Value;
use sonard::{
    geometry::{DVec2, Pose},
    grid_file,
    interpret::grid::{Grid, MapScore, MapYaml, PathSettings, ideal, score, to_pgm},
    scene::{Scene, shipped},
};
use tempfile::TempDir;

use crate::common::{run, stderr};

/// Map in a folder, and the ideal map of a shipped scene on its cells.
fn with_ideal(folder: &str, scene: &str) -> (Grid, Grid) {
    let map = grid_file::read(folder.as_ref(), |_| {}).expect("a map");
    let scene = Scene::from_json(shipped::text(scene).expect("shipped")).expect("a scene");
    let places: Vec<DVec2> = scene.poses.values().map(Pose::position).collect();
    let ideal = ideal(&scene, *map.shape(), &places);
    (map, ideal)
}

/// Compares the map in a folder with a shipped scene.
pub(crate) fn score_of(folder: &str, scene: &str) -> MapScore {
    let (map, ideal) = with_ideal(folder, scene);
    score(&map, &ideal, &PathSettings::default()).expect("maps of one region")
}

/// Writes the ideal map of a shipped scene on the cells of the map in `folder`.
pub(crate) fn write_ideal(folder: &str, scene: &str, out: &str) {
    let (_, ideal) = with_ideal(folder, scene);
    fs::create_dir_all(out).expect("a folder");
    fs::write(format!("{out}/map.pgm"), to_pgm(&ideal)).expect("written");
    let yaml = MapYaml::new(ideal.shape(), "map.pgm").to_text();
    fs::write(format!("{out}/map.yaml"), yaml).expect("written");
}

/// Simulated scans of a room from three places, as files.
fn logs(folder: &Path) -> Vec<String> {
    let places = ["0.7,0.8,0", "1.6,0.5,90", "1.1,2.2,0"];
    let log = |place: &&str| {
        let path = folder.join(format!("{place}.jsonl")).to_str().expect("plain path").to_owned();
        let output = run(&[
            "simulate",
            "--scene",
            "two-surface-room",
            "--pose",
            place,
            "--max-range",
            "4",
            "-o",
            &path,
        ]);
        assert!(output.status.success(), "{}", stderr(&output));
        path
    };
    places.iter().map(log).collect()
}

/// Runs and reads the one object it prints.
fn object(arguments: &[&str]) -> Value {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    serde_json::from_slice(&output.stdout).expect("one object")
}

fn with<'a>(verb: &'a str, logs: &'a [String], further: &[&'a str]) -> Vec<&'a str> {
    let logs = logs.iter().map(String::as_str);
    std::iter::once(verb).chain(logs).chain(further.iter().copied()).collect()
}

#[test]
fn feature_prediction() {
    let folder = TempDir::new().expect("a temporary folder");
    let logs = logs(folder.path());
    let path = |name: &str| folder.path().join(name).to_str().expect("plain path").to_owned();
    let scores: Vec<MapScore> = ["on", "off"]
        .iter()
        .map(|switch| {
            let out = path(switch);
            let confidences = path("confidences.jsonl");
            let further = [
                "--out",
                &out,
                "--feature-prediction",
                switch,
                "--json",
                "--confidences",
                &confidences,
            ];
            let map = object(&with("map", &logs, &further));
            assert_eq!((map["scans"].as_u64(), map["readings"].as_u64()), (Some(3), Some(1200)));
            let pgm = fs::read(folder.path().join(switch).join("map.pgm")).expect("written");
            assert!(pgm.starts_with(b"P5\n"));
            if *switch == "on" {
                let text = fs::read_to_string(&confidences).expect("written");
                assert_eq!(text.lines().count(), 1200, "a confidence for every reading");
            }
            score_of(&out, "two-surface-room")
        })
        .collect();
    let [on, off] = scores.as_slice() else { panic!("two maps") };
    assert!(on.correlation_percent > off.correlation_percent, "{on:?} {off:?}");
    assert!(on.map_score_percent < off.map_score_percent, "{on:?} {off:?}");
    assert!(on.map_score_occupied_percent < off.map_score_occupied_percent, "{on:?} {off:?}");
    assert!(on.false_positive_paths_percent < off.false_positive_paths_percent, "{on:?} {off:?}");
}

#[test]
fn ideal_map_scores_one() {
    let folder = TempDir::new().expect("a temporary folder");
    let logs = logs(folder.path());
    let [map, ideal] =
        ["map", "ideal"].map(|name| folder.path().join(name).to_str().expect("path").to_owned());
    let further = ["--out", &map, "--region", "-0.5,-0.5,4.1,3.5", "--model", "physical", "--json"];
    let made = object(&with("map", &logs, &further));
    assert_eq!((made["width"].as_u64(), made["height"].as_u64()), (Some(92), Some(80)));
    write_ideal(&map, "two-surface-room", &ideal);
    let perfect = score_of(&ideal, "two-surface-room");
    assert_eq!(perfect.false_positive_paths_percent, Some(0.0));
    assert!(perfect.correlation_percent.expect("it varies") > 99.9);
}

#[test]
fn map_of_one_scan() {
    let folder = TempDir::new().expect("a temporary folder");
    let logs = logs(folder.path());
    let out = folder.path().join("map").to_str().expect("plain path").to_owned();
    let of = |logs: &[String]| object(&with("map", logs, &["--out", &out, "--json"]));
    let (one, three) = (of(&logs[..1]), of(&logs));
    assert_eq!((one["evidence"].as_u64(), three["evidence"].as_u64()), (Some(5), Some(2)));
    let free_m2 = |map: &Value| map["free_cells"].as_f64().expect("a number") * 0.05 * 0.05;
    // The room has 10.8 square metres; one scan covers a good part of it.
    assert!(free_m2(&one) > 2.0, "{one}");
}

#[test]
fn annotated_confidences() {
    let folder = TempDir::new().expect("a temporary folder");
    let log = &logs(folder.path())[0];
    let path = |name: &str| folder.path().join(name).to_str().expect("plain path").to_owned();
    let (out, confidences) = (path("trusted.jsonl"), path("confidences.jsonl"));
    let output = run(&["log", "annotate", log, "-o", &out]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(run(&["log", "verify", &out]).status.success());
    let read = |path: &str| -> Vec<Value> {
        let text = fs::read_to_string(path).expect("written");
        text.lines().map(|line| serde_json::from_str(line).expect("a record")).collect()
    };
    // They are what `sonard map` uses, and all else is as it was.
    object(&["map", log, "--out", &path("map"), "--confidences", &confidences, "--json"]);
    let used: Vec<Value> = read(&confidences).iter().map(|one| one["confidence"].clone()).collect();
    let (annotated, plain) = (read(&out), read(log));
    let pings = annotated.iter().filter(|record| record["type"] == "ping");
    assert_eq!(pings.map(|ping| ping["confidence"].clone()).collect::<Vec<_>>(), used);
    assert!(used.iter().any(|one| one.as_f64() < Some(0.4)), "some are doubted");
    let without = annotated.into_iter().map(|mut record| {
        record.as_object_mut().expect("an object").remove("confidence");
        record
    });
    assert_eq!(without.collect::<Vec<_>>(), plain);

    let picture = path("trusted.svg");
    let output = run(&["plot", &out, "--kind", "confidence", "-o", &picture]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(fs::read_to_string(&picture).expect("written").contains("contradicted"));
    // In place is refused.
    let output = run(&["log", "annotate", log, "-o", log]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn wrong_laser_scans() {
    let folder = TempDir::new().expect("a temporary folder");
    let file = folder.path().join("laser.jsonl");
    let path = file.to_str().expect("plain path");
    let pose = r#""pose":{"x_m":0,"y_m":0,"heading_deg":0}"#;
    for (line, words) in [
        ("nonsense", "laser.jsonl:2"),
        (
            &format!(r#"{{{pose},"returns":[{{"azimuth_deg":"x","range_m":1}}]}}"#),
            "returns[0].azimuth_deg",
        ),
        (
            &format!(
                r#"{{{pose},"returns":[{{"azimuth_deg":1,"range_m":1}},{{"azimuth_deg":0,"range_m":1}}]}}"#
            ),
            "follows",
        ),
        (
            &format!(r#"{{{pose},"returns":[{{"azimuth_deg":1,"range_m":-1}}]}}"#),
            "returns[0].range_m",
        ),
        (r#"{"returns":[]}"#, "pose"),
    ] {
        fs::write(&file, format!("{{{pose},\"returns\":[]}}\n{line}\n")).expect("written");
        let output = run(&["lines", "--laser", path]);
        assert_eq!(output.status.code(), Some(2), "{line}");
        let printed = stderr(&output).replace('\n', " ");
        assert!(
            printed.contains(words) && printed.contains("give one JSON object"),
            "{words}: {printed}"
        );
    }
}

#[test]
fn lines() {
    let folder = TempDir::new().expect("a temporary folder");
    let logs = logs(folder.path());
    let picture = folder.path().join("lines.png").to_str().expect("plain path").to_owned();
    let output = run(&with("lines", &logs, &["--json", "-o", &picture]));
    assert!(output.status.success(), "{}", stderr(&output));
    let lines: Vec<Value> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("a line"))
        .collect();
    // The west wall, x = 0, is seen from all three places.
    let on_west = |line: &&Value| {
        ["from_m", "to_m"].iter().all(|end| line[end][0].as_f64().is_some_and(|x| x.abs() < 0.03))
    };
    assert!(lines.iter().any(|line| on_west(&line)), "{lines:?}");
    assert_eq!(&fs::read(picture).expect("written")[..4], b"\x89PNG");
}

#[test]
fn wrong_input() {
    let folder = TempDir::new().expect("a temporary folder");
    let logs = logs(folder.path());
    let out = folder.path().join("map").to_str().expect("plain path").to_owned();
    let empty = folder.path().join("empty.jsonl");
    fs::write(&empty, "").expect("written");
    let empty = empty.to_str().expect("plain path").to_owned();
    let small = ["--out", &out, "--region", "0,0,1,1"];
    assert!(run(&with("map", &logs, &small)).status.success());
    for (arguments, words) in [
        (vec!["map", &empty, "--out", &out], "sonard scan"),
        (with("map", &logs, &["--out", &out, "--resolution", "0"]), "resolution"),
        (with("map", &logs, &["--out", &out, "--resolution", "1e-9"]), "too many"),
        (with("map", &logs, &["--out", &out, "--region", "1,2,3"]), "X0,Y0,X1,Y1"),
        (with("map", &logs, &["--out", &out, "--region", "1,1,0,0"]), "no area"),
        (with("map", &logs, &["--out", &out, "--max-range", "0"]), "greater than 0"),
        (vec!["lines", &empty], "sonard scan"),
        (with("lines", &logs, &["--logical", "0"]), "greater than 0"),
    ] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).replace('\n', " ").contains(words), "{words}: {}", stderr(&output));
    }
}

#[test]
fn update_of_a_map() {
    let folder = TempDir::new().expect("a temporary folder");
    let logs = logs(folder.path());
    let path = |name: &str| folder.path().join(name).to_str().expect("plain path").to_owned();
    let (first, both) = (path("first"), path("both"));
    let alone = ["--out", &first, "--region", "-1,-1,4,4", "--scan-weight", "1", "--json"];
    let of_one = object(&with("map", &logs[..1], &alone));
    let went_on = object(&with("map", &logs[1..], &["--update", &first, "--out", &both, "--json"]));
    for kept in ["width", "height", "origin_m", "resolution_m"] {
        assert_eq!(of_one[kept], went_on[kept], "{kept}");
    }
    assert_eq!(went_on["evidence"].as_u64(), Some(1), "evidence of a map is not counted again");
    let unknown = |map: &Value| map["unknown_cells"].as_u64().expect("a count");
    assert!(unknown(&went_on) < unknown(&of_one), "{of_one} {went_on}");

    let refused = run(&with("map", &logs, &["--update", &path("nowhere"), "--out", &both]));
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("nowhere"), "{}", stderr(&refused));
}
