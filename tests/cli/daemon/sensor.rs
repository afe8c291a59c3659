//! Another sensor, while the daemon runs.

use std::fs;

use serde_json::{Value, json};
use sonard_test_support::in_process::{Daemon, start_array};

use super::clean_log;

const TURN: [&str; 4] = ["--set", "plan.step_deg=3.6", "--set", "model.max_range_m=3"];

fn scan(daemon: &Daemon, number: u64) {
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(number);
}

fn echoes(pings: &Value) -> usize {
    pings.as_array().expect("readings").iter().filter(|ping| ping["status"] == "echo").count()
}

#[test]
fn preview_apply_and_restore() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &TURN);
    daemon.wait_for("ready");
    let own = daemon.get("/v1/sensor").json();
    assert_eq!((&own["name"], &own["pending"]), (&json!("senscomp-6500"), &Value::Null));
    let presets = daemon.get("/v1/sensors").json();
    let names: Vec<&Value> =
        presets.as_array().expect("presets").iter().map(|one| &one["name"]).collect();
    assert!(names.len() >= 7 && names.contains(&&json!("hc-sr04")), "{names:?}");

    // With a higher threshold the preview has fewer echoes; the sensor is unchanged.
    let insensitive = json!({"threshold": 0.9});
    let preview = |sensor: &Value| {
        let reply = daemon.send("POST", "/v1/preview", &json!({"sensor": sensor}).to_string());
        assert_eq!(reply.status, 200, "{}", reply.json());
        reply.json()["pings"].clone()
    };
    let (now, then) = (echoes(&preview(&json!({}))), echoes(&preview(&insensitive)));
    assert!(then < now, "{then} of {now}");
    assert_eq!(daemon.get("/v1/sensor").json(), own);

    // Lists are accepted only where the schema has lists.
    let steps = json!([{"until_us": 9000, "gain_db": -3}, {"until_us": null, "gain_db": 0}]);
    preview(&json!({"gain": {"kind": "steps", "steps": steps}}));
    for wrong in
        [json!([0.9]), json!({"gain": {"kind": "steps", "steps": [[9000, -3], [null, 0]]}})]
    {
        let reply = daemon.send("PUT", "/v1/sensor", &wrong.to_string());
        assert_eq!(reply.status, 422, "{wrong}: {}", reply.json());
    }
    // While a scan is under way it waits for the next one.
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_until("a scan", || daemon.status()["scan"]["done"].as_u64() > Some(2));
    assert_eq!(daemon.send("PUT", "/v1/sensor", &insensitive.to_string()).status, 202);
    let status = daemon.status();
    assert_eq!(status["sensor"]["threshold"], own["threshold"]);
    assert_eq!(status["pending"]["sensor"]["threshold"], 0.9);
    assert_eq!(daemon.get("/v1/setup").json()["pending"]["sensor"]["threshold"], 0.9);
    daemon.wait_for_scans(1);
    assert_eq!(daemon.status()["sensor"]["threshold"], 0.9);
    scan(&daemon, 2);
    assert_eq!(daemon.send("DELETE", "/v1/sensor", "").status, 202);
    scan(&daemon, 3);
    assert_eq!(daemon.get("/v1/sensor").json(), own);
    let log = clean_log(folder.path());
    let thresholds: Vec<f64> = log
        .of_type("session")
        .map(|session| session["sensor"]["threshold"].as_f64().expect("a threshold"))
        .collect();
    let own = own["threshold"].as_f64().expect("a threshold");
    assert_eq!(thresholds, [own, 0.9, own], "each begins a session");
    // What the scans were predicted by is what was previewed.
    let scans: Vec<&Value> = log.of_type("scan_start").collect();
    let predicted = log
        .of_type("ping")
        .filter(|ping| ping["scan"] == scans[1]["scan"] && ping["sim"]["status"] == "echo");
    assert_eq!(predicted.count(), then);
    daemon.stop();
}

#[test]
fn rejected_by_device_or_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("s.toml");
    fs::write(&file, "[model]\nthreshold = 0.03\n").expect("there is room");
    let with_file = ["--config", file.to_str().expect("plain path")];
    let mut daemon = Daemon::start_mock(folder.path(), &[&TURN[..], &with_file].concat());
    daemon.wait_for("ready");
    for (body, status, words) in [
        (r#"{"preset":"ear"}"#, 422, "no sensor preset"),
        (r#"{"threshold":0}"#, 422, "threshold is 0"),
        (r#"{"treshold":0.1}"#, 422, "treshold"),
        (r#"{"threshold":0.1}"#, 409, "model.threshold"),
        (r#"{"blanking_us":20000}"#, 409, "listening window"),
        (r#"{"blanking_us":100}"#, 409, "minimum blanking is 500 us"),
    ] {
        let reply = daemon.send("PUT", "/v1/sensor", body);
        assert_eq!(reply.status, status, "{body}: {}", reply.json());
        let message = reply.json()["error"].as_str().expect("words").to_owned();
        assert!(message.contains(words), "{body}: {message}");
    }
    assert_eq!(daemon.status()["pending"]["sensor"], Value::Null);
    assert_eq!(daemon.send("PUT", "/v1/sensor", r#"{"blanking_us":900}"#).status, 202);
    // A reloaded configuration keeps the sensor unless it changes a key of the sensor.
    for (text, blanking_us) in
        [("[model]\nthreshold = 0.04\n", 900.0), ("[model]\nsensor = \"polaroid-chirp\"\n", 1600.0)]
    {
        fs::write(&file, text).expect("there is room");
        daemon.reload();
        daemon.wait_until(text, || {
            let model = daemon.get("/v1/setup").json()["model"].clone();
            text.contains("sensor") == (model["sensor"] == "polaroid-chirp")
                && (text.contains("sensor") || model["threshold"] == 0.04)
        });
        assert_eq!(daemon.get("/v1/sensor").json()["blanking_us"], blanking_us, "{text}");
    }
    daemon.stop();
}

#[test]
fn preview_rejects_like_apply() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &TURN);
    daemon.wait_for("ready");
    for (part, body, status) in [
        ("sensor", json!({"blanking_us": 5}), 409),
        ("sensor", json!({"blanking_us": 20000}), 409),
        ("sensor", json!({"threshold": 0}), 422),
        ("sensor", json!({"preset": "ear"}), 422),
        ("sensor", json!({"blanking_us": 900}), 202),
        ("plan", json!({"from_deg": 0, "to_deg": 90, "step_deg": 1, "pings_per_stop": 1}), 409),
        ("plan", json!({"from_deg": 0, "to_deg": 90, "step_deg": 0, "pings_per_stop": 1}), 422),
        ("plan", json!({"from_deg": 0, "to_deg": 90, "step_deg": 1.8, "pings_per_stop": 1}), 202),
        ("pose", json!({"x_m": -9, "y_m": 1, "heading_deg": 0}), 409),
        ("air", json!({"temperature_c": 20, "humidity_percent": 101}), 422),
        ("air", json!({"temperature_c": 70}), 422),
        ("air", json!({"temperature_c": 25}), 202),
    ] {
        let mut request = json!({});
        request[part] = body.clone();
        let previewed = daemon.send("POST", "/v1/preview", &request.to_string());
        let ordered = daemon.send("PUT", &format!("/v1/{part}"), &body.to_string());
        assert_eq!(ordered.status, status, "{request}: {}", ordered.json());
        if status == 202 {
            assert_eq!(previewed.status, 200, "{request}: {}", previewed.json());
        } else {
            assert_eq!(previewed.status, status, "{request}: {}", previewed.json());
            assert_eq!(previewed.json(), ordered.json(), "{request}");
        }
    }
    daemon.stop();
}

#[test]
fn sensor_of_an_array() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start_array(folder.path(), &[]);
    let pose = daemon.get("/v1/pose").json();
    let ahead = json!({"x_m": pose["x_m"], "y_m": pose["y_m"],
                       "heading_deg": pose["heading_deg"].as_f64().map(|deg| deg + 30.0)});
    let requested = json!({"pose": ahead, "sensor": {"threshold": 0.5}}).to_string();
    let reply = daemon.send("POST", "/v1/preview", &requested);
    assert_eq!(reply.status, 200, "{}", reply.json());
    let previewed = reply.json();
    assert_eq!(previewed["pings"].as_array().map(Vec::len), Some(8));
    assert_eq!(daemon.send("PUT", "/v1/pose", &ahead.to_string()).status, 202);
    assert_eq!(daemon.send("PUT", "/v1/sensor", r#"{"threshold":0.5}"#).status, 202);
    // What a round then reads is what was previewed.
    let newest = || daemon.get("/v1/scan/latest").json();
    let session = || daemon.get("/v1/session").json();
    daemon.wait_until("a round by it", || session()["sensor"]["threshold"] == 0.5);
    let before = newest()["start"]["scan"].clone();
    daemon.wait_until("another round", || newest()["start"]["scan"] != before);
    let scan = newest();
    let id = scan["start"]["scan"].as_str().expect("an id");
    let whole = daemon.get(&format!("/v1/scans/{id}")).json();
    for (printed, read) in previewed["pings"]
        .as_array()
        .expect("them")
        .iter()
        .zip(whole["pings"].as_array().expect("them"))
    {
        for key in ["ranger", "status", "range_m", "viewpoint"] {
            assert_eq!(printed[key], read[key], "{key}: {read}");
        }
    }
    let plan = r#"{"plan":{"from_deg":0,"to_deg":9,"step_deg":0.9,"pings_per_stop":1}}"#;
    assert_eq!(daemon.send("POST", "/v1/preview", plan).status, 409);
    daemon.stop();
}
