//! Survey of an unknown room, through the whole program.

use std::{fs, path::Path, process::Stdio};

use serde_json::Value;

use crate::common::{run, sonard, stderr, wait_until};

/// Inner sides of the room, metres.
const SIDES_M: [f64; 2] = [2.8, 2.3];
/// Stops: x, y in metres and heading in degrees.
const STOPS: [[f64; 3]; 4] =
    [[0.7, 0.6, 20.0], [1.2, 0.9, 65.0], [1.9, 1.3, 100.0], [1.4, 1.6, 190.0]];

fn succeeds(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).expect("text")
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().expect("a plain path").to_owned()
}

/// Scene of a room with these cylinders.
fn room(folder: &Path, cylinders: &Value) -> String {
    let [w, d] = SIDES_M;
    let room = serde_json::json!({
        "name": "room", "materials": {"wall": {"reflectance": 0.97}}, "cylinders": cylinders.as_array().cloned().unwrap_or_default(),
        "walls": [{"id": "wall", "polyline": [[0, 0], [w, 0], [w, d], [0, d]], "closed": true, "material": "wall"}],
    });
    let scene = path(folder, "truth.json");
    fs::write(&scene, room.to_string()).expect("written");
    scene
}

/// Logs of sweeps with a millimetre of noise, whose poses drift by centimetres and degrees, in a
/// room with these cylinders.
fn sweeps(folder: &Path, cylinders: &Value) -> Vec<String> {
    let scene = room(folder, cylinders);
    let log = |(at, [x, y, heading]): (usize, &[f64; 3])| {
        let log = path(folder, &format!("{at}.jsonl"));
        let pose = format!("{x},{y},{heading}");
        let simulate = ["simulate", "--scene", &scene, "--pose", &pose, "-o", &log];
        succeeds(&[&simulate[..], &["--jitter-us", "6", "--max-range", "4"]].concat());
        drift(&log, at as f64, 0.0);
        log
    };
    STOPS.iter().enumerate().map(log).collect()
}

/// Changes the poses in a log by an error that grows along the course: by `by` at its first scan, and
/// by `each` more at each further one.
fn drift(log: &str, mut by: f64, each: f64) {
    let text = fs::read_to_string(log).expect("a log");
    let mut scans = 0;
    let changed = text.lines().map(|line| {
        let mut record: Value = serde_json::from_str(line).expect("JSON");
        if record["type"] == "scan_start" {
            by += if scans == 0 { 0.0 } else { each };
            scans += 1;
        }
        if let Some(pose) = record.get_mut("pose").filter(|pose| pose.is_object()) {
            for (name, error) in [("x_m", 0.012), ("y_m", -0.009), ("heading_deg", 1.1)] {
                let value = pose[name].as_f64().expect("a number");
                pose[name] = (value + by * error).into();
            }
        }
        record.to_string() + "\n"
    });
    let changed: String = changed.collect();
    fs::write(log, changed).expect("written");
}

/// Asserts that the sides of the room are found, in any frame.
fn assert_sides(survey: &Value, tolerance_m: f64) {
    let walls = survey["walls"].as_array().expect("walls");
    let mut lengths_m: Vec<f64> =
        walls.iter().map(|wall| distance_m(&wall["from"]["at_m"], &wall["to"]["at_m"])).collect();
    lengths_m.sort_by(f64::total_cmp);
    let [w, d] = SIDES_M;
    assert_eq!(lengths_m.len(), 4, "{lengths_m:?}");
    for (found_m, expected_m) in lengths_m.iter().zip([d, d, w, w]) {
        assert!((found_m - expected_m).abs() < tolerance_m, "{lengths_m:?}");
    }
}

fn distance_m(a: &Value, b: &Value) -> f64 {
    let by = |at: usize| a[at].as_f64().expect("metres") - b[at].as_f64().expect("metres");
    by(0).hypot(by(1))
}

#[test]
fn survey_reconstructs_room_and_course() {
    let folder = tempfile::tempdir().expect("a folder");
    let logs = sweeps(folder.path(), &Value::Null);
    let out = path(folder.path(), "out");
    let mut arguments = vec!["survey", "--odometry", "0.05,5", "--out", &out, "--max-range", "4"];
    arguments.extend(logs.iter().map(String::as_str));
    let printed = succeeds(&arguments);
    assert!(printed.starts_with("4 walls from 4 sweeps"), "{printed}");
    let read = |name: &str| fs::read_to_string(format!("{out}/{name}")).expect(name);
    let survey: Value = serde_json::from_str(&read("survey.json")).expect("JSON");
    assert_eq!(survey["end"], "complete", "{survey}");

    // Lengths are independent of the frame, which is the drifting odometry's.
    assert_sides(&survey, 0.001);
    let poses: Vec<Value> = survey["poses"].as_array().expect("poses").clone();
    for (at, found) in poses.iter().enumerate() {
        for (other, to) in poses.iter().enumerate().skip(at + 1) {
            let [a, b] = [&found["pose"], &to["pose"]];
            let by = |name: &str| b[name].as_f64().expect(name) - a[name].as_f64().expect(name);
            let expected = [0, 1, 2].map(|of: usize| STOPS[other][of] - STOPS[at][of]);
            let off_m = by("x_m").hypot(by("y_m")) - expected[0].hypot(expected[1]);
            let off_deg = (by("heading_deg") - expected[2] + 180.0).rem_euclid(360.0) - 180.0;
            assert!(off_m.abs() < 0.001 && off_deg.abs() < 0.1, "{off_m} {off_deg} {found} {to}");
        }
    }
    assert_eq!(read("poses.csv").lines().count(), 1 + STOPS.len());
    assert!(read("report.md").contains("![Floor plan](plan.png)"));
    // Nothing is open in a closed room.
    assert!(printed.contains("next view: none"), "{printed}");
    assert!(survey["next_view"].is_null() && !read("plan.svg").contains("next view"), "{survey}");
    assert!(read("plan.svg").contains("observed wall"));

    // Without odometry, the room looks alike from two poses half a turn apart.
    let blind = path(folder.path(), "blind");
    let mut without = vec!["survey", "--no-odometry", "--out", &blind, "--max-range", "4"];
    without.extend(logs.iter().map(String::as_str));
    let printed = succeeds(&without);
    assert!(printed.contains("3 sweeps explained as well by other poses"), "{printed}");

    // The scene is one for other verbs, in which readings agree and are found again.
    let scene = path(Path::new(&out), "scene.json");
    succeeds(&["scene", "check", &scene]);
    let pose = &poses[2]["pose"];
    let pose = ["x_m", "y_m", "heading_deg"].map(|name| pose[name].to_string()).join(",");
    let compare = ["compare", &logs[2], "--json", "--scene", &scene, "--pose", &pose];
    let compared: Value =
        serde_json::from_str(succeeds(&compare).lines().next().expect("a line")).expect("JSON");
    let [agree, both] = ["agree", "both_echo"].map(|name| compared[name].as_f64().expect(name));
    assert!(agree / both > 0.97, "{compared}");
    let located = succeeds(&["locate", &logs[2], "--json", "--scene", &scene]);
    let is_near = |line: &str| {
        let found: Value = serde_json::from_str(line).expect("JSON");
        ["x_m", "y_m"].iter().all(|name| {
            let at = |value: &Value| value[*name].as_f64().expect("metres");
            (at(&found) - at(&poses[2]["pose"])).abs() < 0.01
        })
    };
    assert!(located.lines().any(is_near), "{located}");

    // Results are kept without --force.
    assert_eq!(run(&arguments).status.code(), Some(2));
}

/// From two stops in an arm of an L the other arm is open.
#[test]
fn survey_proposes_the_next_view() {
    let folder = tempfile::tempdir().expect("a folder");
    let room = serde_json::json!({
        "name": "room", "materials": {"wall": {"reflectance": 0.97}},
        "walls": [{"id": "wall", "closed": true, "material": "wall",
            "polyline": [[0, 0], [3.4, 0], [3.4, 1.5], [1.6, 1.5], [1.6, 2.9], [0, 2.9]]}],
    });
    let [scene, a, b, out] =
        ["truth.json", "a.jsonl", "b.jsonl", "out"].map(|name| path(folder.path(), name));
    fs::write(&scene, room.to_string()).expect("written");
    for (log, pose) in [(&a, "2.6,0.4,20"), (&b, "3,0.8,20")] {
        let simulate = ["simulate", "--scene", &scene, "--pose", pose, "-o", log];
        succeeds(&[&simulate[..], &["--max-range", "4"]].concat());
    }
    let printed = succeeds(&["survey", &a, &b, "--max-range", "4", "--out", &out]);
    assert!(printed.contains("next view: a full turn at ("), "{printed}");
    let read = |name: &str| fs::read_to_string(format!("{out}/{name}")).expect(name);
    assert!(read("report.md").contains("## Next view"), "{}", read("report.md"));
    assert!(read("plan.svg").contains("next view"));
    let survey: Value = serde_json::from_str(&read("survey.json")).expect("JSON");
    let view = &survey["next_view"];
    let [gain, open] =
        [&view["gain_nats"], &survey["open_nats"]].map(|of| of.as_f64().expect("nats"));
    assert!(gain > 0.1 && gain <= open, "{survey}");
    assert!(view["resolves"].as_array().is_some_and(|parts| !parts.is_empty()), "{view}");
}

#[test]
fn survey_finds_a_post() {
    let folder = tempfile::tempdir().expect("a folder");
    let leg = serde_json::json!([{"id": "leg", "center": [2.1, 0.6], "radius_m": 0.06, "material": "wall"}]);
    let logs = sweeps(folder.path(), &leg);
    let out = path(folder.path(), "out");
    let mut arguments = vec!["survey", "--out", &out, "--max-range", "4"];
    arguments.extend(logs.iter().map(String::as_str));
    let printed = succeeds(&arguments);
    assert!(printed.starts_with("4 walls and 1 post from 4 sweeps"), "{printed}");
    assert!(printed.lines().any(|line| line.contains("post-1") && line.contains("observed")));
    let read = |name: &str| fs::read_to_string(format!("{out}/{name}")).expect(name);
    assert!(read("report.md").contains("| post-1 |"));
    let scene: Value = serde_json::from_str(&read("scene.json")).expect("JSON");
    let [post] = &scene["cylinders"].as_array().expect("cylinders")[..] else { panic!("{scene}") };
    let expected = serde_json::json!([2.1, 0.6]);
    assert!(distance_m(&post["center"], &expected) < 0.01, "{post}");
    assert!((post["radius_m"].as_f64().expect("metres") - 0.06).abs() < 0.003, "{post}");
    succeeds(&["scene", "check", &path(Path::new(&out), "scene.json")]);
}

#[test]
fn survey_states_what_is_missing() {
    let folder = tempfile::tempdir().expect("a folder");
    let logs = sweeps(folder.path(), &Value::Null);
    let out = path(folder.path(), "out");
    let rejected_at = |out: &str, arguments: &[&str], reason: &str| {
        let output = run(&[&["survey", "--out", out], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).contains(reason), "{arguments:?}: {}", stderr(&output));
    };
    let rejected = |arguments: &[&str], reason: &str| {
        rejected_at(&out, arguments, reason);
        assert!(!Path::new(&out).exists());
    };
    rejected(&[&logs[0]], "a survey needs at least 2");
    rejected(&[&logs[0], &logs[1], "--odometry", "5"], "such as 0.05,5");
    rejected(&[&logs[0], &logs[1], "--odometry", "0.1,2", "--no-odometry"], "cannot be used with");
    // Nothing is nearer than the range that still counts.
    rejected(&[&logs[0], &logs[1], "--max-range", "0.3"], "no arc of equal ranges");
    // A search that ends early leaves its best plan and an exit code.
    let output = run(&["survey", &logs[0], &logs[1], "--out", &out, "--max-scenes", "100"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(printed.contains("the budget is spent before the search ended"), "{printed}");
    assert!(Path::new(&out).join("scene.json").exists());
    // The same command continues from there, with the result of an uninterrupted survey.
    let unfinished = Path::new(&out).join("unfinished.jsonl");
    assert!(unfinished.exists());
    rejected_at(&out, &[&logs[0], &logs[2]], "it belongs to another survey");
    let whole = path(folder.path(), "whole");
    for out in [&out, &whole] {
        succeeds(&["survey", &logs[0], &logs[1], "--out", out, "--max-scenes", "5000"]);
    }
    let [resumed, whole] = [&out, &whole]
        .map(|out| fs::read_to_string(Path::new(out).join("survey.json")).expect("a survey"));
    assert_eq!(resumed, whole);
    assert!(!unfinished.exists());
}

#[test]
fn killed_survey_continues() {
    let folder = tempfile::tempdir().expect("a folder");
    let logs = sweeps(folder.path(), &Value::Null);
    let [killed, whole] = ["killed", "whole"].map(|name| path(folder.path(), name));
    let arguments = |out: &str| {
        let mut arguments = vec!["survey".to_owned(), "--out".to_owned(), out.to_owned()];
        arguments.extend(logs.clone());
        arguments
    };
    let unfinished = Path::new(&killed).join("unfinished.jsonl");
    let of_killed = arguments(&killed);
    let of_killed: Vec<&str> = of_killed.iter().map(String::as_str).collect();
    let mut survey = sonard(&of_killed);
    let survey = survey.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    let mut survey = survey.expect("the program starts");
    wait_until("a checkpoint", || unfinished.exists());
    survey.kill().expect("it runs");
    survey.wait().expect("its state");
    assert!(!Path::new(&killed).join("scene.json").exists());
    // The checkpoint is complete, and the same command continues from it.
    let scored = fs::read_to_string(&unfinished).expect("a checkpoint");
    assert_eq!((scored.lines().count(), scored.ends_with("]]\n")), (2, true));
    for out in [&killed, &whole] {
        let arguments = arguments(out);
        succeeds(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    }
    let [resumed, whole] = [&killed, &whole]
        .map(|out| fs::read_to_string(Path::new(out).join("survey.json")).expect("a survey"));
    assert_eq!(resumed, whole);
    assert!(!unfinished.exists());
}

#[test]
fn collected_scans_of_unknown_room_give_scene_for_all_verbs() {
    let folder = tempfile::tempdir().expect("a folder");
    let [w, d] = SIDES_M;
    let room = serde_json::json!({
        "name": "room", "materials": {"wall": {"reflectance": 0.97}},
        "walls": [{"id": "wall", "polyline": [[0, 0], [w, 0], [w, d], [0, d]], "closed": true, "material": "wall"}],
    });
    let at = |name: &str| path(folder.path(), name);
    let [truth, plan, out, surveyed] = ["truth.json", "plan.toml", "out", "surveyed"].map(at);
    fs::write(&truth, room.to_string()).expect("written");
    let stops = STOPS[..3].iter().map(|[x, y, deg]| format!("\"{x},{y},{deg}\""));
    let stops = stops.collect::<Vec<_>>().join(", ");
    let keys =
        format!("[place]\nscene = \"\"\n[poses]\nlist = [{stops}]\n[sensor]\nmax_range_m = 4\n");
    fs::write(&plan, keys).expect("written");
    // Only the mock needs a room.
    let without = run(&["collect", &plan, "--mock", "--out", &out]);
    assert_eq!(without.status.code(), Some(2));
    assert!(stderr(&without).contains("--truth"), "{}", stderr(&without));
    succeeds(&["collect", &plan, "--mock", "--truth", &truth, "--out", &out]);
    let scans = at("out/scans");
    succeeds(&["survey", &scans, "--max-range", "4", "--out", &surveyed]);

    let scene = at("surveyed/scene.json");
    succeeds(&["scene", "check", &scene]);
    let logs: Vec<String> =
        (1..=3).map(|pose| at(&format!("out/scans/p00{pose}-r01.jsonl"))).collect();
    let logs: Vec<&str> = logs.iter().map(String::as_str).collect();
    let lines = |arguments: &[&str]| -> Vec<Value> {
        let printed = succeeds(&[arguments, &logs, &["--json", "--scene", &scene]].concat());
        printed.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    };
    // The last line is about all scans.
    let compared = lines(&["compare"]).pop().expect("a line");
    let [agree, both] = ["agree", "both_echo"].map(|name| compared[name].as_f64().expect(name));
    assert!(both > 600.0 && agree / both > 0.97, "{compared}");
    let fitted = lines(&["calibrate", "--fit", "pose,walls"]);
    let walls: Vec<_> = fitted
        .iter()
        .filter(|line| line["name"].as_str().is_some_and(|name| name.starts_with("wall ")))
        .collect();
    assert_eq!(walls.len(), 4, "{fitted:?}");
    for wall in walls {
        assert!(wall["change"].as_f64().expect("metres").abs() < 0.003, "{wall}");
    }
    let located = lines(&["locate"]);
    for [x, y, _] in &STOPS[..3] {
        let is_near = |line: &Value| {
            let [x_m, y_m] = ["x_m", "y_m"].map(|name| line[name].as_f64().expect("metres"));
            (x_m - x).hypot(y_m - y) < 0.01
        };
        assert!(located.iter().any(is_near), "{x} {y}: {located:?}");
    }
    let predicted = at("predicted.jsonl");
    succeeds(&["predict", logs[0], "--scene", &scene, "-o", &predicted]);
    succeeds(&["map", &predicted, "--out", &at("map")]);
    assert!(fs::read(at("map/map.pgm")).expect("a map").starts_with(b"P5"));
}

#[test]
fn survey_fits_the_ranger() {
    let folder = tempfile::tempdir().expect("a folder");
    let logs = sweeps(folder.path(), &Value::Null);
    let preset: Value =
        serde_json::from_str(&succeeds(&["sensor", "show", "senscomp-6500"])).expect("JSON");
    // Simulated with the preset; the survey assumes one that is 3 dB less sensitive.
    let mut assumed = preset.clone();
    let threshold = preset["threshold"].as_f64().expect("a number");
    assumed["threshold"] = (threshold * 10f64.powf(3.0 / 20.0)).into();
    let sensor = path(folder.path(), "assumed.json");
    fs::write(&sensor, assumed.to_string()).expect("written");
    let out = path(folder.path(), "out");
    let arguments = ["survey", "--sensor", &sensor, "--fit", "threshold", "--max-range", "4"];
    let mut arguments = [&arguments[..], &["--out", &out]].concat();
    arguments.extend(logs.iter().map(String::as_str));
    let printed = succeeds(&arguments);
    assert!(printed.contains("threshold_db"), "{printed}");
    let read = |name: &str| -> Value {
        let text = fs::read_to_string(format!("{out}/{name}")).expect(name);
        serde_json::from_str(&text).expect("JSON")
    };
    let of = read("survey.json")["fitted"]["numbers"][0].clone();
    let number = |key: &str| of[key].as_f64().expect(key);
    assert!((number("value") - number("assumed") + 3.0).abs() < 0.3, "{of}");
    assert_eq!(of["is_determined"], true, "{of}");
    let fitted = read("sensor.json")["threshold"].as_f64().expect("a number");
    assert!((20.0 * (fitted / threshold).log10()).abs() < 0.3, "{fitted} {threshold}");
    assert!(read("air.json").is_object());
    let sensor = path(Path::new(&out), "sensor.json");
    let scene = path(Path::new(&out), "scene.json");
    succeeds(&["locate", &logs[0], "--scene", &scene, "--sensor", &sensor]);

    let out = path(folder.path(), "rejected");
    let output = run(&["survey", &logs[0], &logs[1], "--fit", "walls", "--out", &out]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("walls can't be fitted by a survey"), "{}", stderr(&output));
}

/// Log of a ring of rangers that moves through the room, whose poses drift by centimetres and degrees.
fn ring_log(folder: &Path) -> String {
    let (scene, course) = (room(folder, &Value::Null), path(folder, "course.csv"));
    let along = (0..7).map(|at| format!("{},0.7,0", 0.6 + 0.2 * f64::from(at)));
    let up = (0..6).map(|at| format!("1.9,{},90", 0.7 + 0.15 * f64::from(at)));
    let rows: Vec<String> =
        ["x_m,y_m,heading_deg".to_owned()].into_iter().chain(along.chain(up)).collect();
    fs::write(&course, rows.join("\n")).expect("written");
    let log = path(folder, "ring.jsonl");
    let simulate = ["simulate", "--array", "ring-12", "--scene", &scene, "--poses", &course];
    succeeds(&[&simulate[..], &["--max-range", "4", "-o", &log]].concat());
    drift(&log, 0.0, 0.35);
    log
}

#[test]
fn array_on_a_moving_robot_gives_the_room() {
    let folder = tempfile::tempdir().expect("a folder");
    let (log, out) = (ring_log(folder.path()), path(folder.path(), "out"));
    let printed = succeeds(&["survey", &log, "--max-range", "4", "--out", &out]);
    assert!(printed.starts_with("4 walls from 13 rounds"), "{printed}");
    assert!(printed.contains("next view: none: no reachable place resolves"), "{printed}");
    let text = fs::read_to_string(format!("{out}/survey.json")).expect("a survey");
    let survey: Value = serde_json::from_str(&text).expect("JSON");
    assert_sides(&survey, 0.02);
    // Of each reading a cause, in rounds of twelve.
    let causes = survey["causes"].as_array().expect("causes");
    assert!(
        causes.len() == 13
            && causes.iter().all(|of| of.as_array().is_some_and(|of| of.len() == 12))
    );
    let picture = fs::read_to_string(format!("{out}/plan.svg")).expect("a picture");
    assert!(picture.contains("13 rounds"), "{}", &picture[..400]);

    // Rounds that are farther apart.
    let sparse = path(folder.path(), "sparse");
    let spacing = ["survey", &log, "--max-range", "4", "--out", &sparse, "--round-spacing", "0.35"];
    let printed = run(&[&spacing[..], &["--max-scenes", "100"]].concat());
    let printed = String::from_utf8(printed.stdout).expect("text");
    assert!(printed.lines().next().is_some_and(|line| line.contains("from 6 rounds")), "{printed}");
}

#[test]
fn logs_that_do_not_belong_to_a_course_of_an_array_are_rejected() {
    let folder = tempfile::tempdir().expect("a folder");
    let ring = ring_log(folder.path());
    let sweep = sweeps(folder.path(), &Value::Null).swap_remove(0);
    let out = path(folder.path(), "out");
    let rejected = |arguments: &[&str], parts: &[&str]| {
        let output = run(&[&["survey", "--out", &out], arguments].concat());
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        assert!(!Path::new(&out).join("survey.json").exists());
    };
    rejected(&[&ring, &sweep], &["scans of an array and of a ranger", "survey them separately"]);
    rejected(&[&sweep, &ring], &["scans of an array and of a ranger", "survey them separately"]);
    rejected(&[&ring, "--fit", "mounting"], &["can't be fitted", "it fits threshold"]);
    // Sixteen courses, one after the other.
    let text = fs::read_to_string(&ring).expect("a log");
    let many = path(folder.path(), "many.jsonl");
    let course = |number: u32| {
        let renamed = text.lines().map(move |line| {
            let mut record: Value = serde_json::from_str(line).expect("JSON");
            if let Some(id) = record["scan"].as_str() {
                record["scan"] = format!("{number:08x}{}", &id[8..]).into();
            }
            record.to_string() + "\n"
        });
        renamed.collect::<String>()
    };
    fs::write(&many, (0..16).map(course).collect::<String>()).expect("written");
    rejected(&[&many], &["208 rounds", "--round-spacing"]);
}
