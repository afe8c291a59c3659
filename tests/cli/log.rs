//! `sonard log` and `sonard compare` as a user meets them.

use std::{fs, path::Path};

use serde_json::Value;

use crate::common::{Log, run, sonard, stderr};

const LOG: &str = include_str!("../fixtures/small.jsonl");

/// Runs the verb and checks its exit code; gives standard output and standard error together.
#[track_caller]
fn check(arguments: &[&str], code: i32) -> String {
    let output = run(arguments);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned() + &stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {printed}");
    assert!(!printed.contains("panicked"), "{printed}");
    printed
}

fn log_of(folder: &Path, bytes: impl AsRef<[u8]>) -> String {
    let path = folder.join("scan.jsonl");
    fs::write(&path, bytes).expect("a temporary file");
    path.to_str().expect("plain path").to_owned()
}

#[test]
fn repair_of_an_incomplete_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let torn = &LOG[..LOG.len() - 200];
    let log = &log_of(folder.path(), torn);
    let printed = check(&["log", "verify", log], 1);
    assert!(printed.contains(":10: problem: the last line is torn"), "{printed}");
    assert!(printed.contains("sonard log repair"), "{printed}");
    let printed = check(&["log", "repair", log], 0);
    assert!(printed.contains("9 records kept") && printed.contains(".orig"), "{printed}");
    let whole = torn.rfind('\n').expect("many lines") + 1;
    assert_eq!(fs::read_to_string(log).expect("it is there"), torn[..whole]);
    let original = fs::read_to_string(format!("{log}.orig")).expect("it is kept");
    assert_eq!(original, torn);
    let printed = check(&["log", "verify", log], 0);
    assert!(printed.contains("warning: scan") && printed.contains("no scan_end"), "{printed}");
    check(&["log", "verify", "--strict", log], 1);
    assert!(check(&["log", "repair", log], 0).contains("nothing to repair"));
}

#[test]
fn damaged_lines() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = &log_of(folder.path(), LOG.replacen("\"ping\"", "\"ping", 1));
    let printed = check(&["log", "verify", log], 1);
    assert!(printed.contains("scan.jsonl:3: problem: column "), "{printed}");
    let printed = check(&["log", "repair", log], 1);
    let length = LOG.lines().nth(2).expect("a reading").len() - 1;
    assert!(printed.contains(&format!("scan.jsonl:3: removed {length} byte")), "{printed}");
    let json = check(&["log", "verify", "--json", log], 1);
    let lines: Vec<Value> =
        json.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(lines[0]["kind"], "wrong_count");
    assert_eq!(lines[lines.len() - 1]["clean"], false);
}

#[test]
fn unreadable_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let empty = folder.path().to_str().expect("plain path");
    for verb in [&["log", "verify"][..], &["log", "repair"], &["log", "show"], &["compare"]] {
        for path in ["/no/such/log.jsonl", empty] {
            let printed = check(&[verb, &[path]].concat(), 2);
            assert!(printed.contains(path) && printed.contains("help:"), "{printed}");
        }
    }
    check(&["log", "repair", "-"], 2);
}

#[test]
fn show() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = &log_of(folder.path(), format!("{LOG}rubbish\n"));
    let printed = check(&["log", "show", "--readings", log], 0);
    for part in [
        "senscomp-6500",
        "simple-room",
        "5a0e7f5e",
        "7/7",
        "0.774,0.085,0",
        "3 reflections: south, north, south",
        "(repaired)",
        "stopped: on request",
        "line 12",
    ] {
        assert!(printed.contains(part), "{part} is not in:\n{printed}");
    }
    let json = check(&["log", "show", "--json", log], 0);
    let types: Vec<Value> = json
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).expect("JSON")["type"].clone())
        .collect();
    assert_eq!(types, ["session", "scan", "event", "damaged"]);
    let mut follow = sonard(&["log", "show", "--follow", "-"]);
    let output = follow.stdin(fs::File::open(log).expect("it is there")).output().expect("runs");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        printed.contains("ends after 0.4 s: 7 beams") && printed.contains("line 12"),
        "{printed}"
    );
}

#[test]
fn compare_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = &log_of(folder.path(), LOG);
    let printed = check(&["compare", "--json", log], 0);
    let json: Value = serde_json::from_str(&printed).expect("one object");
    for (field, expected) in [("beams", 6), ("both_echo", 4), ("agree", 3), ("measured_only", 0)] {
        assert_eq!(json[field], expected, "{field}");
    }
    assert_eq!(json["verdicts"]["multiple"], 1);
    // Of several logs, one more for all of them.
    let printed = check(&["compare", "--json", log, log], 0);
    let lines: Vec<Value> =
        printed.lines().map(|line| serde_json::from_str(line).expect("an object")).collect();
    assert_eq!((lines.len(), &lines[0], &lines[1]), (3, &json, &json));
    assert_eq!((&lines[2]["logs"], &lines[2]["beams"]), (&2.into(), &12.into()));
    let printed = check(&["compare", log], 0);
    assert!(printed.contains("Largest residuals") && printed.contains("300.0 mm"), "{printed}");
    // In another scene the predictions are others, and it still runs.
    let printed = check(&["compare", "--json", "--scene", "simple-room", log], 0);
    let again: Value = serde_json::from_str(&printed).expect("one object and no complaint");
    assert_eq!(again["beams"], 6);
    assert_ne!(again["median_abs_residual_m"], json["median_abs_residual_m"]);
}

#[test]
fn simulated_scan_agrees() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("sim.jsonl");
    let log = log.to_str().expect("plain path");
    let pose = ["--scene", "simple-room", "--pose", "fig9"];
    check(&[&["simulate"][..], &pose, &["--step-deg", "9", "-o", log]].concat(), 0);
    check(&["log", "verify", "--strict", log], 0);
    let printed = check(&["compare", log], 0);
    assert!(printed.contains("--scene adds them"), "{printed}");
    let printed = check(&["compare", "--json", "--scene", "simple-room", log], 0);
    let json: Value = serde_json::from_str(&printed).expect("one object");
    assert_eq!(json["beams"], 40);
    assert_eq!(json["agree"], json["both_echo"]);
    assert_eq!(json["verdicts"]["unexplained"], 0);
    assert_eq!(json["p90_abs_residual_m"], 0.0);
}

#[test]
fn empty_and_partial_logs() {
    let folder = tempfile::tempdir().expect("a folder");
    let session_only = LOG.lines().next().expect("a session").to_owned() + "\n";
    for (bytes, code, part) in [
        ("", 2, "contains no records"),
        ("rubbish\n", 2, "contains no records"),
        (&session_only, 0, "contains no readings"),
    ] {
        let log = &log_of(folder.path(), bytes);
        let printed = check(&["compare", log], code);
        assert!(printed.contains(part), "{printed}");
    }
    let one: String = LOG.lines().take(3).map(|line| format!("{line}\n")).collect();
    let log = &log_of(folder.path(), one);
    let json: Value =
        serde_json::from_str(&check(&["compare", "--json", log], 0)).expect("one object");
    assert_eq!((&json["beams"], &json["agree_fraction"]), (&1.into(), &1.0.into()));
}

#[test]
fn predictions_of_a_moving_robot() {
    let folder = tempfile::tempdir().expect("a folder");
    let simulated = |pose: &str| {
        let turn = ["--step-deg", "9", "--max-range", "2"];
        let made =
            run(&[&["simulate", "--scene", "simple-room", "--pose", pose][..], &turn].concat());
        String::from_utf8(made.stdout).expect("text")
    };
    // The second half of one scan is taken from the other one's place.
    let [from, to] = ["fig9", "fig7"].map(simulated);
    let scan_of = |text: &str| Log::parse(text).end()["scan"].to_string();
    let to = to.replace(&scan_of(&to), &scan_of(&from));
    let moved = from.lines().zip(to.lines()).map(|(at_rest, moved)| {
        let mut ping: Value = serde_json::from_str(moved).expect("a record");
        if ping["index"].as_u64() < Some(20) {
            return at_rest.to_owned();
        }
        ping["pose"] = serde_json::json!({"x_m": 0.834, "y_m": 0.345, "heading_deg": 0.0});
        ping.to_string()
    });
    let log = folder.path().join("moved.jsonl");
    fs::write(&log, moved.map(|line| line + "\n").collect::<String>()).expect("there is room");
    let log = log.to_str().expect("a plain path");
    let compared = run(&["compare", log, "--scene", "simple-room", "--json"]);
    let compared: Value = serde_json::from_slice(&compared.stdout).expect("one object");
    assert_eq!((&compared["beams"], &compared["p90_abs_residual_m"]), (&40.into(), &0.0.into()));
    assert_eq!(compared["verdicts"]["unexplained"], 0, "{compared}");
}

#[test]
fn unsupported_formats() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out").display().to_string();
    let picture = folder.path().join("out.svg").display().to_string();
    for format in ["0", "2"] {
        let text = LOG.replacen("\"format\":1", &format!("\"format\":{format}"), 1);
        let log = &log_of(folder.path(), &text);
        for arguments in [
            vec!["compare", log],
            vec!["plot", log, "-o", &picture],
            vec!["map", log, "--out", &out],
            vec!["lines", log, "-o", &picture],
            vec!["interpret", log],
            vec!["export", log, "--to", "csv"],
            vec!["predict", log, "--scene", "simple-room"],
            vec!["calibrate", log, "--scene", "simple-room"],
            vec!["locate", log, "--scene", "simple-room"],
            vec!["log", "annotate", log],
            vec!["log", "show", log],
        ] {
            // Lines of the message are wrapped.
            let printed = check(&arguments, 2).replace('\u{2502}', " ");
            let printed = printed.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(
                printed.contains(&format!("log format {format} is not supported")),
                "{printed}"
            );
            assert!(printed.contains("read the log with the version that wrote it"), "{printed}");
        }
        let printed = check(&["log", "verify", log], 1);
        assert!(printed.contains(&format!("problem: format: log format {format} ")), "{printed}");
        check(&["log", "repair", log], 0);
        assert_eq!(fs::read_to_string(log).expect("readable"), text);
    }
}
