//! Results derived from scans by the API: echo traces, previews, maps, lines and features.

use std::fs;

use serde_json::{Value, json};
use sonard::api::{Findings, WholeScan};
use sonard_test_support::in_process::{Daemon, start_array};

use super::write_scans;
use crate::common::{run, stderr};

/// A full turn of a hundred beams.
const TURN: [&str; 4] = ["--set", "plan.step_deg=3.6", "--set", "model.max_range_m=3"];

fn scan_once(daemon: &Daemon) -> Value {
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    let latest = daemon.get("/v1/scan/latest").json();
    let scan = latest["start"]["scan"].as_str().expect("an id");
    daemon.get(&format!("/v1/scans/{scan}")).json()
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().expect("a list").iter().filter_map(Value::as_f64).collect()
}

#[test]
fn preview_matches_the_prediction() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &TURN);
    daemon.wait_for("ready");
    let before = daemon.status();
    let there = json!({"x_m": 0.5, "y_m": 0.4, "heading_deg": 30.0});
    let requested = json!({"pose": there, "air": {"temperature_c": 31.0}}).to_string();
    let reply = daemon.send("POST", "/v1/preview", &requested);
    assert_eq!(reply.status, 200, "{}", reply.json());
    let expected: WholeScan = serde_json::from_value(reply.json()).expect("a scan");
    assert_eq!(serde_json::to_value(&expected).expect("JSON"), reply.json());
    assert_eq!(expected.pings.len(), 100);
    // Nothing was changed by it.
    for part in ["pose", "plan", "pending"] {
        assert_eq!(daemon.status()[part], before[part], "{part}");
    }
    assert_eq!(daemon.send("PUT", "/v1/pose", &there.to_string()).status, 202);
    assert_eq!(daemon.send("PUT", "/v1/air", r#"{"temperature_c":31}"#).status, 202);
    let taken = scan_once(&daemon);
    for (expected, reading) in expected.pings.iter().zip(taken["pings"].as_array().expect("them")) {
        let printed = reading["sim"]["range_m"].as_f64();
        assert_eq!(expected.ping.range_m, printed, "{reading}");
        let verdict = serde_json::to_value(expected.annotations.verdict).expect("JSON");
        assert!(verdict.is_string() && verdict != "unexplained", "{verdict}");
    }
    // What it leaves out is as in the next scan.
    let same = daemon.send("POST", "/v1/preview", "{}").json();
    assert_eq!(same["start"]["pose"], there);
}

#[test]
fn rejected_previews() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &TURN);
    for (body, status, words) in [
        (r#"{"pose":{"x_m":99,"y_m":0,"heading_deg":0}}"#, 409, "outside"),
        (
            r#"{"plan":{"from_deg":0,"to_deg":360,"step_deg":0.9,"pings_per_stop":20}}"#,
            422,
            "8000 beams",
        ),
        (r#"{"plan":{"from_deg":9,"to_deg":0,"step_deg":0.9,"pings_per_stop":1}}"#, 422, ""),
        (r#"{"air":{"temperature_c":900}}"#, 422, "temperature"),
        (r#"{"sensor":"hc-sr04"}"#, 422, "sensor"),
    ] {
        let reply = daemon.send("POST", "/v1/preview", body);
        assert_eq!(reply.status, status, "{body}: {}", reply.json());
        let message = reply.json()["error"].as_str().expect("words").to_owned();
        assert!(message.contains(words), "{body}: {message}");
    }
}

#[test]
fn echo_trace_of_a_beam() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &TURN);
    daemon.wait_for("ready");
    let scan = scan_once(&daemon);
    let id = scan["start"]["scan"].as_str().expect("an id");
    let beam = daemon.get(&format!("/v1/scans/{id}/beams/75")).json();
    let trace = &beam["trace"];
    let (envelope, threshold) = (numbers(&trace["envelope"]), numbers(&trace["threshold"]));
    assert_eq!(envelope.len(), threshold.len());
    assert!((100..=4096).contains(&envelope.len()), "{}", envelope.len());
    // It first rises over the threshold, past the blanking, where the model reads.
    let step_us = trace["step_us"].as_f64().expect("a step");
    let blanking_us = trace["blanking_us"].as_f64().expect("a time");
    let over = (0..envelope.len())
        .find(|&i| i as f64 * step_us > blanking_us && envelope[i] > threshold[i])
        .expect("a crossing of the threshold");
    let there_m = over as f64 * step_us * trace["m_per_us"].as_f64().expect("a speed");
    let read_m = scan["pings"][75]["sim"]["range_m"].as_f64().expect("a range");
    assert!((there_m - read_m).abs() < 0.02, "{there_m} and {read_m}");
}

#[test]
fn map_lines_and_features() {
    let folder = tempfile::tempdir().expect("a folder");
    let corridor = ["--mock", "--scene", "two-surface-room", "--pose", "middle"];
    let daemon = Daemon::start(folder.path(), &[&corridor[..], &TURN].concat());
    daemon.wait_for("ready");
    let scan = scan_once(&daemon);
    let id = scan["start"]["scan"].as_str().expect("an id");
    let found = daemon.get(&format!("/v1/scans/{id}/findings")).json();
    let read: Findings = serde_json::from_value(found.clone()).expect("findings");
    assert_eq!(serde_json::to_value(&read).expect("JSON"), found);
    assert_eq!(read.unavailable_reason, None);
    let map = read.map.expect("a map");
    assert_eq!(map.cells.len() % map.width, 0);
    assert!(map.cells.len() <= 41_000 && map.cells.iter().all(|cell| (-1..=100).contains(cell)));
    assert!(
        map.cells.iter().any(|cell| *cell > 60)
            && map.cells.iter().any(|cell| (0..40).contains(cell))
    );
    assert!(!read.features.is_empty(), "{found}");
    // The same that the program makes of the log.
    let log = fs::read_dir(folder.path().join("log")).expect("logs").next().expect("one");
    let log = log.expect("readable").path();
    let lines = run(&["lines", log.to_str().expect("plain"), "--json"]);
    assert!(lines.status.success(), "{}", stderr(&lines));
    let lines = String::from_utf8(lines.stdout).expect("text").lines().count();
    assert_eq!(read.lines.len(), lines);
    let missing = daemon.get("/v1/scans/00000000-0000-4000-8000-000000000000/findings");
    assert_eq!(missing.status, 404);
}

#[test]
fn arrays_and_long_scans() {
    let folder = tempfile::tempdir().expect("a folder");
    write_scans(&folder.path().join("log"), 1, 4001);
    let daemon = start_array(folder.path(), &[]);
    daemon.wait_for_scans(1);
    let scans = daemon.get("/v1/scans?limit=500").json();
    let scans = scans.as_array().expect("scans");
    let findings = |scan: &Value| {
        daemon.get(&format!("/v1/scans/{}/findings", scan["scan"].as_str().expect("an id")))
    };
    let of_array = scans.iter().find(|scan| !scan["end"].is_null()).expect("one");
    let found = findings(of_array).json();
    assert!(
        found["unavailable_reason"].as_str().is_some_and(|why| why.contains("scanning ranger")),
        "{found}"
    );
    assert_eq!(found["features"], json!([]));
    let long = findings(scans.last().expect("the long one"));
    assert_eq!(long.status, 409, "{}", long.json());
    assert!(long.json()["error"].as_str().is_some_and(|error| error.contains("4000")));
}
