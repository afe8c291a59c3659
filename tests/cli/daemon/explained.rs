//! Changes of pose, air or sensor that explain a scan better than the assumed ones.

use serde_json::{Value, json};
use sonard_test_support::{in_process::Daemon, rig};

use super::{clean_log, logs};

/// Takes a scan at the pose in the configuration.
fn scan(daemon: &Daemon, pose: [f64; 3], number: u64) {
    let [x_m, y_m, heading_deg] = pose;
    let pose = json!({ "x_m": x_m, "y_m": y_m, "heading_deg": heading_deg });
    assert_eq!(daemon.send("PUT", "/v1/pose", &pose.to_string()).status, 202);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(number);
}

/// Returns the explanation of the last scan, once there is one.
fn explanations(daemon: &Daemon) -> Vec<Value> {
    let reported =
        || daemon.health()["fit"]["explanations"].as_array().cloned().unwrap_or_default();
    daemon.wait_until("an explanation", || !reported().is_empty());
    reported()
}

fn events(folder: &std::path::Path) -> Vec<String> {
    let log = clean_log(folder);
    let kind = |event: &&Value| event["kind"] == "explanation";
    let detail = |event: &Value| event["detail"].as_str().unwrap_or_default().to_owned();
    log.of_type("event").filter(kind).map(detail).collect()
}

#[test]
fn wrong_pose_is_reported_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut daemon = Daemon::start(folder.path(), &rig::OPTIONS);
    daemon.plug("", 1);
    daemon.wait_for("ready");
    let truth = daemon.get("/v1/pose").json();
    let [x_m, y_m, heading_deg] =
        ["x_m", "y_m", "heading_deg"].map(|key| truth[key].as_f64().expect("a number"));
    // Two centimetres beside where it is, and then where it is.
    let beside = [x_m + 0.02, y_m + 0.02, heading_deg];
    scan(&daemon, beside, 1);
    let found = explanations(&daemon);
    assert!(["pose", "together"].iter().any(|change| found[0]["change"] == *change), "{found:?}");
    for name in ["x_m", "y_m"] {
        let all = found[0]["estimates"].as_array().expect("estimates");
        let of = all.iter().find(|estimate| estimate["name"] == name).expect("it is there");
        let value = of["value"].as_f64().expect("a number");
        assert!((value + 0.02).abs() < 0.004, "{name}: {found:?}");
    }
    let printed = String::from_utf8(daemon.run_client("status").stdout).expect("text");
    assert!(printed.contains("fit      better with "), "{printed}");
    assert_eq!(daemon.get("/v1/pose").json()["x_m"].as_f64(), Some(x_m + 0.02));
    scan(&daemon, [x_m, y_m, heading_deg], 2);
    let log = logs(folder.path()).remove(0);
    let is_withdrawn = || std::fs::read_to_string(&log).is_ok_and(|log| log.contains("no longer"));
    daemon.wait_until("the event", is_withdrawn);
    assert_eq!(daemon.health()["fit"]["explanations"], json!([]));
    for number in [3, 4] {
        scan(&daemon, beside, number);
        explanations(&daemon);
    }
    daemon.stop();
    let events = events(folder.path());
    assert_eq!(events.len(), 3, "{events:?}");
    assert!(events[0].contains("better explained: ") && events[2].contains("better explained: "));
    assert!(events[1].contains("no longer better explained"), "{events:?}");
}

#[test]
fn few_beams_are_not_explained() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut daemon = Daemon::start(folder.path(), &rig::OPTIONS);
    daemon.plug("", 1);
    daemon.wait_for("ready");
    let [x_m, y_m, heading_deg] = ["x_m", "y_m", "heading_deg"]
        .map(|key| daemon.get("/v1/pose").json()[key].as_f64().expect("a number"));
    let wrong = [x_m + 0.02, y_m + 0.02, heading_deg];
    for (number, step_deg) in [(1, 18.0), (2, 0.9)] {
        let plan = json!({"from_deg": 0, "to_deg": 360, "step_deg": step_deg, "pings_per_stop": 1});
        assert_eq!(daemon.send("PUT", "/v1/plan", &plan.to_string()).status, 202);
        scan(&daemon, wrong, number);
    }
    explanations(&daemon);
    let latest = daemon.get("/v1/scan/latest").json();
    let id = latest["start"]["scan"].as_str().expect("an id").to_owned();
    daemon.stop();
    // Of the scans with 20 and with 400 beams, only the second one is explained.
    let events = events(folder.path());
    assert!(events.len() == 1 && events[0].contains(&id), "{id}: {events:?}");
}
