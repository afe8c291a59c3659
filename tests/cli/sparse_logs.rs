//! Logs without usable readings, or with too few, in every verb that interprets scans.

use std::{fs, path::Path};

use tempfile::TempDir;

use crate::common::{run, stderr};

/// A simulated scan's lines.
fn scan(folder: &Path, pose: &str) -> Vec<String> {
    let path = folder.join("scan.jsonl");
    let path = path.to_str().expect("plain path");
    let output = run(&[
        "simulate",
        "--scene",
        "two-surface-room",
        "--pose",
        pose,
        "--max-range",
        "3",
        "--step-deg",
        "3.6",
        "--force",
        "-o",
        path,
    ]);
    assert!(output.status.success(), "{}", stderr(&output));
    fs::read_to_string(path).expect("written").lines().map(str::to_owned).collect()
}

fn is_ping(line: &str) -> bool {
    line.contains(r#""type":"ping""#)
}

/// Runs each verb on a log: exit code, standard output, standard error.
fn verbs(folder: &Path, log: &[String]) -> Vec<(&'static str, Option<i32>, String, String)> {
    let path = folder.join("log.jsonl");
    fs::write(&path, format!("{}\n", log.join("\n"))).expect("written");
    let (path, map) = (path.to_str().expect("plain"), folder.join("map"));
    let map = map.to_str().expect("plain");
    [
        ("interpret", vec!["interpret", path]),
        ("lines", vec!["lines", path]),
        ("map", vec!["map", path, "--out", map]),
        ("annotate", vec!["log", "annotate", path]),
    ]
    .map(|(verb, arguments)| {
        let output = run(&arguments);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        (verb, output.status.code(), text, stderr(&output))
    })
    .to_vec()
}

#[test]
fn single_reading() {
    let folder = TempDir::new().expect("a temporary folder");
    let mut pings = 0;
    let one: Vec<String> = scan(folder.path(), "middle")
        .into_iter()
        .filter(|line| !is_ping(line) || std::mem::replace(&mut pings, 1) == 0)
        .collect();
    for (verb, code, _, words) in verbs(folder.path(), &one) {
        assert_eq!(code, Some(2), "{verb}: {words}");
        assert!(
            words.contains("1 usable stop") && words.contains("sonard scan"),
            "{verb}: {words}"
        );
    }
}

#[test]
fn no_echoes() {
    let folder = TempDir::new().expect("a temporary folder");
    let silent: Vec<String> = scan(folder.path(), "middle")
        .into_iter()
        .map(|line| match is_ping(&line) {
            true => {
                let mut ping: serde_json::Value = serde_json::from_str(&line).expect("a record");
                (ping["status"], ping["range_m"]) = ("no_echo".into(), serde_json::Value::Null);
                ping.to_string()
            }
            false => line,
        })
        .collect();
    for (verb, code, text, words) in verbs(folder.path(), &silent) {
        assert_eq!(code, Some(0), "{verb}: {words}");
        let expected = match verb {
            "interpret" => "no features: no beam has an echo",
            "lines" => "0 lines; 0 readings discarded",
            "map" => "0 occupied",
            _ => r#""confidence":0.5"#,
        };
        assert!(text.contains(expected), "{verb}: {text}");
    }
}

#[test]
fn repeated_pose() {
    let folder = TempDir::new().expect("a temporary folder");
    let once = scan(folder.path(), "middle");
    let again = scan(folder.path(), "middle");
    let lines = |log: &[String]| {
        let (_, code, text, words) = verbs(folder.path(), log).swap_remove(1);
        assert_eq!(code, Some(0), "{words}");
        text.lines().count()
    };
    // The same readings again add no line.
    assert_eq!(lines(&once), lines(&[once.clone(), again.clone()].concat()));
    for (verb, code, text, words) in verbs(folder.path(), &[once, again].concat()) {
        assert_eq!(code, Some(0), "{verb}: {words}");
        assert!(!text.is_empty(), "{verb}");
    }
}

#[test]
fn non_finite_range() {
    let folder = TempDir::new().expect("a temporary folder");
    let mut log = scan(folder.path(), "middle");
    let at = log.iter().position(|line| is_ping(line) && line.contains(r#""status":"echo""#));
    let at = at.expect("an echo");
    let mut ping: serde_json::Value = serde_json::from_str(&log[at]).expect("a record");
    ping["range_m"] = "RANGE".into();
    log[at] = ping.to_string().replace(r#""RANGE""#, "NaN");
    for (verb, code, _, words) in verbs(folder.path(), &log) {
        assert_eq!(code, Some(0), "{verb}: {words}");
        let words = words.replace('\n', " ");
        assert!(words.contains(&format!("line {}", at + 1)), "{verb}: {words}");
    }
}

#[test]
fn poses_outside_the_map() {
    let folder = TempDir::new().expect("a temporary folder");
    let log = scan(folder.path(), "middle");
    let path = folder.path().join("log.jsonl");
    fs::write(&path, log.join("\n")).expect("written");
    let (path, map) = (path.to_str().expect("plain"), folder.path().join("map"));
    let map = map.to_str().expect("plain");
    let output = run(&["map", path, "--out", map, "--region", "10,10,11,11"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("1 pose outside the map") && text.contains("--region"), "{text}");
}
