//! Logs of format 1, whose paths have `walls` and no points: written by the program as it was before format
//! 2, from a mock, an array, and a scene with heights. Every verb that reads logs still reads them.

use std::path::PathBuf;

use serde_json::Value;

use crate::common::{Log, run, stderr};

fn fixture(name: &str) -> String {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/format-1"));
    folder.join(name).to_str().expect("a plain path").to_owned()
}

fn code(arguments: &[&str]) -> Option<i32> {
    let output = run(arguments);
    assert_ne!(output.status.code(), Some(101), "{}", stderr(&output));
    output.status.code()
}

#[test]
fn every_verb_that_reads_logs_reads_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let scenes = [
        ("scan.jsonl", "simple-room".to_owned()),
        ("array.jsonl", "mcgill-lab".to_owned()),
        ("heights.jsonl", fixture("low-walls.json")),
    ];
    for (name, scene) in scenes {
        let log = fixture(name);
        let copy = out("copy.jsonl");
        std::fs::copy(&log, &copy).expect("copies");
        let mut runs = vec![
            vec!["log", "verify", &log],
            vec!["log", "show", "--readings", &log],
            vec!["log", "repair", &copy],
            vec!["compare", &log],
            vec!["compare", "--scene", &scene, &log],
            vec!["map", &log],
        ];
        let map = out(&format!("map-{name}"));
        runs[5].extend(["--out", &map]);
        let [picture, lines] = ["picture.svg", "lines.svg"].map(out);
        let trusted = out(&format!("trusted-{name}"));
        runs.push(vec!["lines", &log, "-o", &lines]);
        for kind in ["scan", "polar", "residuals", "side-by-side", "confidence"] {
            runs.push(vec!["plot", &log, "--scene", &scene, "--kind", kind, "-o", &picture]);
        }
        runs.push(vec!["plot", &log, "--scene", &scene, "--beam", "0", "-o", &picture]);
        runs.push(vec!["log", "annotate", &log, "-o", &trusted]);
        let predicted = out(&format!("predicted-{name}"));
        runs.push(vec!["predict", &log, "--scene", &scene, "-o", &predicted]);
        let exports = ["csv", "parquet", "mcap"].map(|ending| out(&format!("{name}.{ending}")));
        runs.extend(exports.iter().map(|export| vec!["export", &log, "-o", export]));
        if name == "scan.jsonl" {
            runs.push(vec!["locate", &log, "--scene", &scene]);
            runs.push(vec!["calibrate", &log, "--scene", &scene, "--fit", "delay"]);
        }
        // An array's few bearings are no arcs.
        let is_array = name.starts_with("array");
        assert_eq!(code(&["interpret", &log]), Some(if is_array { 2 } else { 0 }), "{name}");
        for arguments in runs {
            let output = run(&arguments);
            assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
        }
        let unread = std::fs::read(&log).expect("reads") == std::fs::read(&copy).expect("reads");
        assert!(unread, "{name}: whole, so repair leaves it as it is");
    }
}

/// The points come from the model, in the scene that the log names; another scene has no such path.
#[test]
fn their_beams_are_drawn_by_the_model() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("path.svg").to_str().expect("a plain path").to_owned();
    let drawn = |log: &str, scene: &str, beam: &str| {
        let output =
            run(&["plot", &fixture(log), "--scene", scene, "--beam", beam, "-o", &picture]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        std::fs::read_to_string(&picture).expect("a picture")
    };
    let low_walls = fixture("low-walls.json");
    for (log, scene, beam, words) in [
        ("scan.jsonl", "simple-room", "30", "path of 1.6540 m: south, north, south"),
        ("array.jsonl", "mcgill-lab", "0", "path of 1.6280 m: north"),
        ("heights.jsonl", &low_walls, "29", "edge low.top"),
    ] {
        let text = drawn(log, scene, beam);
        assert!(text.contains(words), "{log}: {text}");
    }
    let log = fixture("scan.jsonl");
    let elsewhere = run(&["plot", &log, "--scene", "corridor", "--beam", "30", "-o", &picture]);
    assert_eq!(elsewhere.status.code(), Some(2));
    assert!(stderr(&elsewhere).contains("format 1"), "{}", stderr(&elsewhere));
}

#[test]
fn what_is_written_again_is_of_format_2() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("trusted.jsonl");
    let [log, again] = [fixture("scan.jsonl"), out.to_str().expect("a plain path").to_owned()];
    assert_eq!(code(&["log", "annotate", &log, "-o", &again]), Some(0));
    assert_eq!(code(&["log", "verify", &again]), Some(0));
    let (was, is) = (Log::read(log.as_ref()), Log::read(&out));
    let format = |log: &Log| log.records[0]["format"].clone();
    assert_eq!((format(&was), format(&is)), (1.into(), 2.into()));
    for (was, is) in was.pings().into_iter().zip(is.pings()) {
        let [was, is] = [was, is].map(|ping| &ping["sim"]["path"]);
        let ids = |path: &Value, list: &str| -> Vec<String> {
            let met = path[list].as_array().into_iter().flatten();
            let id = |met: &Value| met.get("id").unwrap_or(met).as_str().map(str::to_owned);
            met.filter_map(id).collect()
        };
        assert_eq!(ids(was, "walls"), ids(is, "interactions"), "{is}");
        let points = is["interactions"].as_array().into_iter().flatten();
        assert!(points.into_iter().all(|met| met.get("point").is_none()), "{is}");
    }
}
