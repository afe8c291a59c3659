//! `sonard plot` as a user runs it.

use std::{fs, path::Path};

use assert_cmd::Command;
use predicates::{prelude::*, str::contains};
use sonard::acoustics::{Air, Sensor};
use tempfile::TempDir;

const SCAN: [&str; 2] =
    ["00000000-0000-4000-8000-000000000001", "10000000-0000-4000-8000-000000000002"];

/// A log of two short scans in the shipped scene `simple-room`.
fn log() -> String {
    let air = Air::new(20.0, 50.0, 101.325).expect("ordinary air");
    let session = serde_json::json!({
        "type": "session", "format": 1, "started": "2026-01-01T00:00:00Z", "sonard": "0.1.0",
        "provenance": "mock", "device": null, "air": sonard::scan::AirRecord::from(&air),
        "sensor": Sensor::preset("senscomp-6500").expect("a preset"),
        "scene": {"name": "simple-room", "sha256": "0"}, "model": {"engine": "fan"}
    });
    let mut log = format!("{session}\n");
    for scan in SCAN {
        log += &format!(
            r#"{{"type":"scan_start","scan":"{scan}","time":"2026-01-01T00:00:00Z","pose":{{"x_m":0.774,"y_m":0.085,"heading_deg":0.0}},"plan":{{"from_deg":0.0,"to_deg":360.0,"step_deg":90.0,"pings_per_stop":1}}}}
"#
        );
        for (index, range) in ["0.927", "0.657", "null", "0.829"].iter().enumerate() {
            let (status, azimuth) = (if *range == "null" { "no_echo" } else { "echo" }, index * 90);
            log += &format!(
                r#"{{"type":"ping","scan":"{scan}","index":{index},"step":0,"azimuth_deg":{azimuth}.0,"time":null,"time_sigma_us":null,"status":"{status}","fired_ticks":null,"echo_ticks":[],"tof_us":null,"range_m":{range},"residual_m":null}}
"#
            );
        }
    }
    log
}

fn sonard(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("sonard").expect("the program is built");
    command.current_dir(folder).arg("plot");
    command
}

fn folder_with_log() -> TempDir {
    let folder = TempDir::new().expect("a temporary folder");
    fs::write(folder.path().join("scan.jsonl"), log()).expect("written");
    folder
}

#[test]
fn svg_and_png() {
    let folder = folder_with_log();
    sonard(folder.path())
        .args(["scan.jsonl", "-o", "a.svg", "-o", "b.png", "--width", "640"])
        .assert()
        .success()
        .stderr(contains("SHA-256"));
    let svg = fs::read_to_string(folder.path().join("a.svg")).expect("written");
    assert!(svg.contains("class=\"walls\"") && svg.contains("2 scans overlaid"));
    let png = fs::read(folder.path().join("b.png")).expect("written");
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    // The header's width, big-endian, comes after signature, length and "IHDR".
    assert_eq!(png[16..20], 640_u32.to_be_bytes());
}

#[test]
fn standard_input_and_output() {
    let folder = folder_with_log();
    for kind in ["scan", "polar", "residuals"] {
        sonard(folder.path())
            .args(["-", "--kind", kind])
            .write_stdin(log())
            .assert()
            .success()
            .stdout(contains("<svg").and(contains("</svg>")));
    }
}

#[test]
fn selected_scan() {
    let folder = folder_with_log();
    for wanted in ["2", "1000", SCAN[1]] {
        sonard(folder.path())
            .args(["scan.jsonl", "--scan", wanted])
            .assert()
            .success()
            .stdout(contains("4 beams").and(contains("overlaid").not()));
    }
}

#[test]
fn wrong_input() {
    let folder = folder_with_log();
    fs::write(folder.path().join("empty.jsonl"), "").expect("written");
    let cases: [(&[&str], &str); 8] = [
        (&["nowhere.jsonl", "-o", "a.svg"], "nowhere.jsonl"),
        (&["empty.jsonl", "-o", "a.svg"], "contains no records"),
        (&["scan.jsonl", "-o", "a.pdf"], ".svg or .png"),
        (&["scan.jsonl", "-o", "a.svg", "--scan", "3"], "1 to 2"),
        (&["scan.jsonl", "-o", "a.svg", "--scan", "ff"], "no such scan"),
        (&["scan.jsonl", "-o", "a.svg", "--scene", "simple-rom"], "simple-room"),
        (&["scan.jsonl", "-o", "a.png", "--width", "0"], "--width"),
        (&["scan.jsonl", "-o", "a.svg", "--kind", "confidence"], "sonard log annotate scan.jsonl"),
    ];
    for (arguments, words) in cases {
        sonard(folder.path()).args(arguments).assert().code(2).stderr(contains(words));
        assert!(!folder.path().join("a.svg").exists(), "{arguments:?} wrote a picture");
    }
    sonard(folder.path())
        .args(["scan.jsonl", "-o", "no/such/folder.svg"])
        .assert()
        .code(2)
        .stderr(contains("no/such/folder.svg"));
}

#[test]
fn damaged_lines_are_skipped() {
    let folder = folder_with_log();
    let damaged = log().replacen("\"type\":\"scan_start\"", "\"type\":\"scan_strat\"", 1);
    sonard(folder.path())
        .arg("-")
        .write_stdin(damaged)
        .assert()
        .success()
        .stdout(contains("</svg>"))
        .stderr(contains("line 2").and(contains("skipped")));
}
