//! `sonard interpret` as a user runs it.

use std::{fs, path::Path};

use predicates::{prelude::*, str::contains};
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{run, sonard, stderr};

/// Simulates `plane-corner-edge` at a pose as the paper's sensor sees it.
fn simulate(folder: &Path, pose: &str) -> String {
    let path = folder.join(format!("{pose}.jsonl")).to_str().expect("plain path").to_owned();
    let output = run(&[
        "simulate",
        "--scene",
        "plane-corner-edge",
        "--pose",
        pose,
        "--sensor",
        "bozma-kuc-60khz",
        "-o",
        &path,
    ]);
    assert!(output.status.success(), "{}", stderr(&output));
    path
}

fn features(arguments: &[&str]) -> Vec<Value> {
    let output = run(arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().map(|line| serde_json::from_str(line).expect("a record")).collect()
}

fn kinds(features: &[Value]) -> Vec<&str> {
    features.iter().map(|feature| feature["kind"].as_str().expect("a kind")).collect()
}

#[test]
fn second_scan_decides() {
    let folder = TempDir::new().expect("a temporary folder");
    let first = simulate(folder.path(), "fig13");
    let one = features(&["interpret", &first, "--json"]);
    assert_eq!(kinds(&one).iter().filter(|kind| **kind == "edge").count(), 2);
    assert!(one.iter().any(|f| f["reason"] == "second_position" && f["next"]["delta_m"].is_f64()));

    let second = simulate(folder.path(), "second-corner");
    let picture = folder.path().join("plan.svg");
    let picture = picture.to_str().expect("plain path");
    let both = features(&["interpret", &first, &second, "--json", "-o", picture]);
    let mut found = kinds(&both);
    found.sort_unstable();
    assert_eq!(found, ["corner", "edge", "edge", "plane", "plane", "plane"]);
    let corner = both.iter().find(|f| f["kind"] == "corner").expect("a corner");
    assert!((corner["beta_deg"].as_f64().expect("beta") - 4.0).abs() < 0.9);
    for name in ["x_m", "y_m", "bearing_deg", "range_m", "extent_deg", "confidence"] {
        assert!(corner[name].is_f64(), "{name}: {corner}");
    }
    assert_eq!(corner["beams"].as_array().map(Vec::len), Some(2));
    let svg = fs::read_to_string(picture).expect("written");
    assert!(svg.contains("corner 22.5") && svg.contains("class=\"walls\""));
}

#[test]
fn wrong_input() {
    let folder = TempDir::new().expect("a temporary folder");
    let log = folder.path().join("empty.jsonl");
    fs::write(&log, "").expect("written");
    let log = log.to_str().expect("plain path");
    for (arguments, words) in [
        (&["interpret", "nowhere.jsonl"][..], "nowhere.jsonl"),
        (&["interpret", log][..], "sonard scan"),
        (&["interpret", log, "-o", "a.gif"][..], ".svg, .png, .geojson or .mcap"),
        (&["interpret", log, "--sigma-e", "0"][..], "greater than 0"),
        (&["interpret", log, "--min-confidence", "2"][..], "from 0 to 1"),
    ] {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(contains(words).eval(&stderr(&output)), "{}", stderr(&output));
    }
}

#[test]
fn help_lists_the_reasons() {
    let output = sonard(&["interpret", "--help"]).output().expect("it runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("second_position") && text.contains("Examples"), "{text}");
}
