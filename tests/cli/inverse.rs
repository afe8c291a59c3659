//! From readings back to poses and parameters, through the whole program.

mod stopped;

use std::{
    fs,
    io::{BufRead as _, BufReader, Write as _},
    path::Path,
    process::Stdio,
};

use serde_json::{Value, json};

use crate::common::{run, sonard, stderr};

/// Runs a verb that should succeed; the objects that it prints.
fn lines(arguments: &[&str]) -> Vec<Value> {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

/// A sweep of a shipped scene, in a file.
fn sweep(folder: &Path, scene: &str, pose: &str, further: &[&str]) -> String {
    let path = folder.join("sweep.jsonl").to_str().expect("a plain path").to_owned();
    let simulate = ["simulate", "--scene", scene, "--pose", pose, "-o", &path, "--force"];
    let output = run(&[&simulate[..], further].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    path
}

/// Air other than usual, and a millimetre of noise.
const COLD: [&str; 4] = ["--temperature-c", "15", "--jitter-us", "6"];

fn number(line: &Value, name: &str) -> f64 {
    line[name].as_f64().unwrap_or_else(|| panic!("{name} of {line}"))
}

#[test]
fn calibration_corrects_inputs() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = sweep(folder.path(), "simple-room", "0.80,0.05,92", &COLD);
    let out = folder.path().join("out");
    let out = out.to_str().expect("a plain path");
    let believed = ["--pose", "0.774,0.085,90", "--temperature-c", "20"];
    let calibrate = ["calibrate", &log, "--json", "--out", out];
    let found = lines(&[&calibrate[..], &believed].concat());
    let speed_m_s =
        sonard::acoustics::Air::new(15.0, 50.0, 101.325).expect("air").sound_speed_m_s();
    let expected =
        [("x_m", 0.80), ("y_m", 0.05), ("heading_deg", 92.0), ("sound_speed", speed_m_s)];
    for (line, (name, value)) in found.iter().zip(expected) {
        assert_eq!(line["name"], name);
        assert!((number(line, "value") - value).abs() < 4.0 * number(line, "sigma"), "{line}");
        let [low, at, high] = ["low", "value", "high"].map(|name| number(line, name));
        assert!(low < at && at < high, "{line}");
        assert_eq!(line["identified"], true);
    }
    assert!(number(&found[0], "sigma") < 1e-3 && number(&found[2], "sigma") < 0.5);
    let poses = fs::read_to_string(format!("{out}/poses.jsonl")).expect("there");
    let pose: Value = serde_json::from_str(&poses).expect("JSON");
    assert!((number(&pose, "x_m") - 0.80).abs() < 1e-3);
    let picture = fs::read_to_string(format!("{out}/residuals.svg")).expect("drawn");
    let agreeing = |name: &str| -> u32 {
        let (_, figures) = picture.split_once(&format!("{name}: ")).expect(name);
        figures.split(' ').next().expect("a count").parse().expect("a number")
    };
    assert!(agreeing("fitted values") > 2 * agreeing("initial values"), "{picture}");
    assert!(picture.contains("SIMULATED") && Path::new(out).join("residuals.png").exists());
    // Sensor and scene are taken by other verbs, under which the readings then agree.
    let pose = ["x_m", "y_m", "heading_deg"].map(|name| number(&pose, name).to_string()).join(",");
    let (sensor, scene) = (format!("{out}/sensor.json"), format!("{out}/scene.json"));
    let speed = number(&found[3], "value").to_string();
    let compare = ["compare", &log, "--json", "--scene", &scene, "--sensor", &sensor];
    let judged = lines(&[&compare[..], &["--pose", &pose, "--sound-speed", &speed]].concat());
    let agree = number(&judged[0], "agree") / number(&judged[0], "both_echo");
    assert!(agree > 0.97, "{}", judged[0]);
    // A second time it keeps what is there.
    let again = run(&[&calibrate[..], &believed].concat());
    assert_eq!(again.status.code(), Some(2), "{}", stderr(&again));
    assert!(stderr(&again).contains("--force"), "{}", stderr(&again));
}

#[test]
fn symmetric_and_wrong_rooms() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = sweep(folder.path(), "simple-room", "0.774,0.085,0", &[]);
    let found = lines(&["locate", &log, "--json"]);
    assert_eq!(found.len(), 2, "{found:?}");
    let total: f64 = found.iter().map(|mode| number(mode, "probability")).sum();
    assert!((total - 1.0).abs() < 1e-6);
    let is_there = |mode: &&Value| (number(mode, "x_m") - 0.774).abs() < 0.02;
    let mode = found.iter().find(is_there).expect("the right one");
    assert!((number(mode, "y_m") - 0.085).abs() < 0.02, "{mode}");
    assert!(number(mode, "heading_deg").abs() < 1.0, "{mode}");
    assert!(number(mode, "explained") > 0.95 && mode["diagnoses"].is_null(), "{mode}");
    let elsewhere = lines(&["locate", &log, "--scene", "oblique-corner", "--json"]);
    assert!(elsewhere[0]["diagnoses"][0]["kind"].is_string(), "{}", elsewhere[0]);
}

/// Each cause of a poor fit is printed with what to do about it, on the next line.
#[test]
fn causes_of_a_poor_fit_have_advice() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = sweep(folder.path(), "simple-room", "fig9", &["--sensor", "hc-sr04"]);
    let output = run(&["locate", &log, "--sensor", "senscomp-6500"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).expect("text");
    for part in [
        "warning: no pose in this scene explains more than",
        "  help: check the scene (the right room",
        "warning: the sensor measures 0.41 to 10.70 m",
        "  help: select the sensor that took the readings",
    ] {
        assert!(text.contains(part), "{text}");
    }
    // With the right sensor there is nothing to advise.
    let output = run(&["locate", &log]);
    assert!(!String::from_utf8_lossy(&output.stdout).contains("warning"), "{output:?}");
}

/// Names of poses are accepted where the scene is given.
#[test]
fn assumed_pose_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = sweep(folder.path(), "simple-room", "fig9", &["--step-deg", "9"]);
    let predict = ["predict", &log, "--scene", "simple-room", "--pose"];
    let [named, given] = ["fig7", "0.834,0.345,0"].map(|pose| {
        let output = run(&[&predict[..], &[pose]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        String::from_utf8(output.stdout).expect("text").lines().skip(1).collect::<String>()
    });
    assert_eq!(named, given);
    let calibrate = ["calibrate", &log, "--search", "quick", "--fit", "pose", "--json"];
    let named = lines(&[&calibrate[..], &["--scene", "simple-room", "--pose", "fig9"]].concat());
    assert!((number(&named[0], "value") - 0.774).abs() < 0.002, "{named:?}");
    let unknown = run(&["compare", &log, "--scene", "simple-room", "--pose", "fig8"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(stderr(&unknown).contains("did you mean"), "{}", stderr(&unknown));
    let nowhere = run(&["compare", &log, "--pose", "fig9"]);
    assert_eq!(nowhere.status.code(), Some(2));
    assert!(stderr(&nowhere).contains("--scene for the names"), "{}", stderr(&nowhere));
}

/// A ranger less sensitive than `locate` assumes, and one whose log states its sensitivity.
#[test]
fn threshold_with_pose() {
    const THRESHOLD: f64 = 0.3;
    let folder = tempfile::tempdir().expect("a folder");
    let usual = sonard::acoustics::Sensor::preset("hc-sr04").expect("a preset");
    let insensitive = sonard::acoustics::Sensor { threshold: THRESHOLD, ..usual };
    let file = folder.path().join("insensitive.json");
    fs::write(&file, serde_json::to_string(&insensitive).expect("JSON")).expect("a file");
    let (file, threshold) = (file.to_str().expect("a plain path"), THRESHOLD.to_string());
    let fit = ["locate", "--fit", "threshold", "--prior", "threshold_db=8", "--json"];
    for (sensor, reported) in [
        (vec!["--sensor", file], vec!["--sensor", "hc-sr04"]),
        (vec!["--sensor", "hc-sr04", "--threshold", &threshold], vec![]),
    ] {
        let steps = ["--step-deg", "4", "--max-range", "4"];
        let log =
            sweep(folder.path(), "two-surface-room", "1.0,1.3,25", &[&sensor[..], &steps].concat());
        let found = lines(&[&fit[..], &[log.as_str()], &reported[..]].concat());
        let off_m = (number(&found[0], "x_m") - 1.0).hypot(number(&found[0], "y_m") - 1.3);
        assert!(off_m < 0.02, "{sensor:?}: {}", found[0]);
        let besides = &found[0]["nuisance"][0];
        assert_eq!(besides["name"], "threshold_db");
        let off_db = number(besides, "value") - 20.0 * THRESHOLD.log10();
        assert!(off_db.abs() < 1.0 && number(besides, "sigma") < 1.0, "{sensor:?}: {besides}");
    }
}

/// A robot drives from one end of a room, whose ends look alike, past a short wall to the other; its log comes through
/// a pipe, and each scan is answered before the next is there.
#[test]
fn course_from_a_growing_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let room = r#"{"name": "long room", "materials": {"plaster": {"reflectance": 0.95}}, "walls": [
        {"id": "w", "polyline": [[0, 0], [5, 0], [5, 1], [0, 1]], "closed": true, "material": "plaster"},
        {"id": "stub", "from": [2.9, 1], "to": [2.9, 0.6], "material": "plaster"}]}"#;
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).expect("a file");
        path.to_str().expect("a plain path").to_owned()
    };
    let scene = file("room.json", room);
    let way = file("trajectory.csv", "x_m,y_m,heading_deg\n2.2,0.4,5\n3.4,0.35,30\n4.4,0.6,80\n");
    let simulate = ["simulate", "--scene", &scene, "--poses", &way, "--step-deg", "4"];
    let log = run(&[&simulate[..], &["--max-range", "1.5"]].concat());
    assert_eq!(log.status.code(), Some(0), "{}", stderr(&log));
    let log = String::from_utf8(log.stdout).expect("text");
    let mut child = sonard(&["locate", "-", "--course", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut to = child.stdin.take().expect("its input");
    let mut from = BufReader::new(child.stdout.take().expect("its output")).lines();
    let is_end = |line: &str| line.starts_with(r#"{"type":"scan_end""#);
    let first = 1 + log.lines().position(is_end).expect("a first scan");
    let lines_of = |text: Vec<&str>| text.join("\n") + "\n";
    to.write_all(lines_of(log.lines().take(first).collect()).as_bytes()).expect("it reads");
    let answer = from.next().expect("an answer").expect("text");
    let answer: Value = serde_json::from_str(&answer).expect("JSON");
    assert!((number(&answer, "x_m") - 2.2).abs() < 0.02, "{answer}");
    to.write_all(lines_of(log.lines().skip(first).collect()).as_bytes()).expect("it reads");
    drop(to);
    let rest: Vec<Value> =
        from.map(|line| serde_json::from_str(&line.expect("text")).expect("JSON")).collect();
    assert!(child.wait().expect("it ends").success());
    let end = rest.last().expect("an answer to the last scan");
    assert!((number(end, "x_m") - 4.4).abs() < 0.02, "{end}");
    assert!(number(end, "probability") > 0.99, "{end}");
    let alone = lines(&["locate", &file("trajectory.jsonl", &log), "--json"]);
    let of_end = alone.iter().filter(|mode| mode["scan"] == end["scan"]);
    assert_eq!(of_end.count(), 2, "{alone:?}");
}

/// Two chair legs and a bin are in a room whose scene has the walls only.
#[test]
fn furniture_does_not_bias() {
    let folder = tempfile::tempdir().expect("a folder");
    let room = fs::read_to_string("scenes/simple-room.json").expect("it ships");
    let mut room: Value = serde_json::from_str(&room).expect("JSON");
    let cylinder = |id: &str, center: [f64; 2], radius_m: f64| json!({"id": id, "center": center, "radius_m": radius_m, "material": "shelving"});
    room["cylinders"] = json!([
        cylinder("leg", [0.58, 0.45], 0.02),
        cylinder("other leg", [0.25, 0.53], 0.03),
        cylinder("bin", [0.38, 0.1], 0.08),
    ]);
    let scene = folder.path().join("furnished.json");
    fs::write(&scene, room.to_string()).expect("a file");
    let log = sweep(folder.path(), scene.to_str().expect("plain"), "0.464,0.371,20", &COLD[2..]);
    let calibrate =
        ["calibrate", &log, "--scene", "simple-room", "--pose", "0.52,0.31,25", "--json"];
    let found = lines(&[&calibrate[..], &["--search", "furnished"]].concat());
    // Without this, the threshold would be 9 dB too low.
    assert_eq!(found[4]["name"], "threshold_db");
    assert!((number(&found[4], "value") - number(&found[4], "prior")).abs() < 3.0, "{}", found[4]);
    for (line, value) in found.iter().zip([0.464, 0.371, 20.0]) {
        let off = (number(line, "value") - value).abs();
        assert!(off < 4.0 * number(line, "sigma") && line["identified"] == true, "{line}");
    }
    assert!(number(&found[0], "sigma") < 5e-3, "{}", found[0]);
}

#[test]
fn unfittable_parameters() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = sweep(folder.path(), "simple-room", "0.774,0.085,0", &["--step-deg", "9"]);
    for (arguments, part) in [
        (vec!["calibrate", &log, "--prior", "gear=0.1"], "is not fitted"),
        (vec!["calibrate", &log, "--prior", "x_m=-1"], "greater than 0"),
        (vec!["calibrate", &log, "--fit", "height"], "neither floor nor ceiling"),
        (vec!["calibrate", &log, "--fit", "everything"], "possible values"),
        (vec!["calibrate", &log, "--search", "everywhere"], "quick, thorough, furnished"),
        (vec!["calibrate", "nowhere.jsonl"], "nowhere.jsonl"),
        (vec!["locate", &log, "--scene", "nowhere"], "nowhere"),
        (vec!["locate", &log, "--spacing-m", "0"], "0.01 to 2"),
        (vec!["locate", &log, "--kidnap-probability", "0.1"], "--course"),
        (vec!["locate", &log, "--prior", "threshold_db=3"], "--fit"),
        (vec!["locate", &log, "--fit", "height"], "neither floor nor ceiling"),
        (vec!["locate", &log, "--fit", "threshold", "--prior", "gear=1"], "is not fitted"),
        (vec!["locate", &log, "--course", "--kidnap-probability", "1.1"], "0 to 1"),
    ] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let printed = stderr(&output);
        assert!(
            printed.contains(part) && !printed.contains("panicked"),
            "{arguments:?}: {printed}"
        );
    }
}

#[test]
fn height_and_correlations() {
    let folder = tempfile::tempdir().expect("a folder");
    let room = r#"{"name": "low room", "materials": {"plaster": {"reflectance": 0.95}},
        "walls": [{"id": "w", "polyline": [[0, 0], [3, 0], [3, 2], [0, 2]], "closed": true, "material": "plaster"}],
        "floor_z_m": 0.0, "ceiling_z_m": 1.6, "poses": {"here": {"x_m": 1.0, "y_m": 0.8, "heading_deg": 20}}}"#;
    let scene = folder.path().join("room.json");
    fs::write(&scene, room).expect("room on the disk");
    let scene = scene.to_str().expect("a plain path");
    let log = sweep(folder.path(), scene, "here", &["--step-deg", "3.6"]);
    let fit = ["calibrate", &log, "--fit", "pose,heading,height"];
    let found = lines(&[&fit[..], &["--json"]].concat());
    let height = found.iter().find(|line| line["name"] == "height_m").expect("a height");
    // Half a metre above the floor by default.
    assert_eq!(number(height, "prior"), 0.5);
    assert!((number(height, "value") - 0.5).abs() < 2.0 * number(height, "sigma"), "{height}");
    let output = run(&fit);
    let printed = String::from_utf8(output.stdout).expect("text");
    // A turn of the robot and one of the stepper's zero are the same, whatever is read.
    let is_told = |line: &str| {
        line.starts_with("strongly correlated: heading_deg of ")
            && line.contains(" and heading_zero_deg (-1")
    };
    assert!(printed.lines().any(is_told), "{printed}");
}
