//! `sonard trace`, and the path of a beam, as a user meets them.

use assert_cmd::Command;
use predicates::{prelude::PredicateBooleanExt, str::contains};
use serde_json::Value;

use crate::common::met;

fn sonard(args: &[&str]) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_sonard")).args(args).assert()
}

#[test]
fn json() {
    let assert =
        sonard(&["trace", "--scene", "echo-traces", "--pose", "d", "--until", "2.5", "--json"]);
    let trace: Value =
        serde_json::from_slice(&assert.success().get_output().stdout).expect("one object");
    let numbers = |name: &str| {
        let list = trace[name].as_array().expect(name);
        list.iter().map(|value| value.as_f64().expect("a number")).collect::<Vec<_>>()
    };
    let (times, envelope, threshold) = (numbers("t_us"), numbers("envelope"), numbers("threshold"));
    assert_eq!((times.len(), times.len()), (envelope.len(), threshold.len()));
    let (highest, _) =
        envelope.iter().enumerate().max_by(|one, other| one.1.total_cmp(other.1)).expect("samples");
    let tof_us = 3.6 / 343.99e-6;
    assert!((times[highest] - tof_us - 200.0).abs() < 200.0, "{}", times[highest]);
    let detection = &trace["detection"];
    assert_eq!(detection["status"], "echo");
    assert_eq!(met(&detection["path"]), ["d-plate", "d-far-object", "d-plate"]);
    let first_us = detection["tof_us"][0].as_f64().expect("a time");
    let crossing = times.iter().position(|t_us| *t_us > first_us + 5.0).expect("later");
    assert!(
        envelope[crossing] > threshold[crossing]
            && envelope[crossing - 4] < threshold[crossing - 4]
    );
}

#[test]
fn table() {
    sonard(&["trace", "--scene", "echo-traces", "--pose", "a"])
        .success()
        .stdout(contains("no echo, and no arrival near the threshold"));
    sonard(&["trace", "--scene", "right-angle-corner", "--pose", "robot", "--azimuth-deg", "199"])
        .success()
        .stdout(
            contains("no echo; the strongest arrival via").and(contains("below the threshold")),
        );
    sonard(&["trace", "--scene", "simple-room", "--pose", "fig7", "--azimuth-deg", "90"])
        .success()
        .stdout(contains("minimum range").and(contains("north")));
}

#[test]
fn isolated_faint_peak() {
    let folder = tempfile::tempdir().expect("a folder");
    let svg = folder.path().join("trace.svg");
    let svg = svg.to_str().expect("plain");
    sonard(&["trace", "--scene", "echo-traces", "--pose", "d", "-o", svg]).success();
    let drawn = std::fs::read_to_string(svg).expect("written");
    // 18 dB below the threshold, and nothing else near it.
    assert!(drawn.contains(">\n1: 0.7") || drawn.contains(">1: 0.7"), "{drawn}");
}

#[test]
fn pictures_and_wrong_input() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("plain").to_owned();
    let (log, svg, way) = (path("fig9.jsonl"), path("trace.svg"), path("way.svg"));
    sonard(&[
        "trace",
        "--scene",
        "simple-room",
        "--pose",
        "fig9",
        "--azimuth-deg",
        "270",
        "-o",
        &svg,
    ])
    .success();
    let text = std::fs::read_to_string(&svg).expect("the picture");
    assert!(text.contains("south, north, south") && text.contains("detection threshold"));
    sonard(&["simulate", "--scene", "simple-room", "--pose", "fig9", "-o", &log]).success();
    sonard(&["plot", &log, "--azimuth-deg", "270", "-o", &way]).success();
    let text = std::fs::read_to_string(&way).expect("the picture");
    assert!(text.contains("path of 1.6540 m: south, north, south"), "{text}");
    sonard(&["plot", &log, "--beam", "300", "--kind", "scan", "-o", &way]).success();
    sonard(&["plot", &log, "--beam", "4000", "-o", &way]).code(2).stderr(contains("0 to 399"));
    sonard(&["trace", "--scene", "simple-room", "--pose", "fig9", "--step-us", "0"])
        .code(2)
        .stderr(contains("from 1 to 1000"));
    sonard(&["trace", "--scene", "simple-room", "--pose", "fig9", "-o", "trace.gif"])
        .code(2)
        .stderr(contains(".svg or .png"));
}

#[test]
fn noise_depends_on_the_seed() {
    let scan = |seed: &str| {
        let args = [
            "simulate",
            "--scene",
            "simple-room",
            "--pose",
            "fig9",
            "--to-deg",
            "36",
            "--noise-floor",
            "0.002",
            "--seed",
            seed,
        ];
        let output = sonard(&args).success().get_output().stdout.clone();
        let text = String::from_utf8(output).expect("UTF-8");
        let ranges = text.lines().filter_map(|line| {
            let record: Value = serde_json::from_str(line).expect("JSON");
            record.get("range_m").cloned()
        });
        ranges.collect::<Vec<_>>()
    };
    assert_eq!(scan("1"), scan("1"));
    assert_ne!(scan("1"), scan("2"));
}
