//! Foxglove's protocol: messages to viewers, access, and the cost of viewers.

mod access;
mod cost;
mod layout;
mod map;
mod viewer;

use std::time::Duration;

use serde_json::{Value, json};
use sonard_test_support::in_process::{Daemon, start_array};

use super::clean_log;
use viewer::{Received, Viewer, range_of};

const SETTINGS: [&str; 8] = [
    "--set",
    "foxglove.enabled=true",
    "--set",
    "model.max_range_m=3",
    "--set",
    "plan.to_deg=36",
    "--set",
    "motion.min_interval_ms=10",
];

/// A daemon with viewers, of a small plan.
fn start(folder: &std::path::Path, further: &[&str]) -> Daemon {
    Daemon::start_mock(folder, &[&SETTINGS, further].concat())
}

/// As [`start`], in a process of its own.
fn start_process(folder: &std::path::Path, further: &[&str]) -> super::Daemon {
    super::Daemon::start_mock(folder, &[&SETTINGS, further].concat())
}

#[test]
fn readings_match_the_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &[]);
    daemon.wait_for("ready");
    let mut viewers = ["foxglove.sdk.v1", "foxglove.websocket.v1"].map(|protocol| {
        let mut viewer = Viewer::new(daemon.connect(), protocol);
        assert_eq!(viewer.protocol, protocol);
        let info = viewer.text();
        assert_eq!((&info["op"], &info["capabilities"]), (&json!("serverInfo"), &json!([])));
        assert!(
            viewer.text()["message"].as_str().is_some_and(|words| words.contains("first scan"))
        );
        viewer
    });
    assert_eq!(daemon.status()["subscribers"]["now"], 2);
    // Topics come with the first scan; its last messages are kept.
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    for viewer in &mut viewers {
        viewer.wait_for_channels();
        viewer.subscribe_to_all();
        let kept = viewer.receive_for(Duration::from_millis(500));
        assert_eq!((kept.of("/tf_static").count(), kept.of("/sonar/scene").count()), (1, 1));
    }
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    let reported = viewers.each_mut().map(|viewer| viewer.until("/sonar/paths"));
    daemon.wait_for_scans(2);
    daemon.wait_for("ready");
    let log = clean_log(folder.path());
    let second = log.of_type("scan_start").nth(1).expect("two scans")["scan"].clone();
    let pings: Vec<&Value> = log.of_type("ping").filter(|ping| ping["scan"] == second).collect();
    for reported in &reported {
        assert_ranges(reported, &pings, "/sonar/range", |ping| ping);
        assert_ranges(reported, &pings, "/sonar/predicted/range", |ping| &ping["sim"]);
        let residuals = reported
            .of("/sonar/residual")
            .map(|(_, bytes)| f64::from_le_bytes(bytes[4..12].try_into().expect("a number")));
        let expected = pings.iter().filter_map(|ping| ping["residual_m"].as_f64());
        assert!(residuals.eq(expected));
        for topic in ["/sonar/scan", "/sonar/points", "/sonar/predicted/points"] {
            assert_eq!(reported.of(topic).count(), 1, "{topic}");
        }
        // At each firing, and when its window ended.
        assert_eq!(reported.of("/tf").count(), 2 * pings.len());
    }
    let [mut one, other] = viewers;
    drop(other);
    one.close();
    daemon.wait_until("they left", || daemon.status()["subscribers"]["now"] == 0);
    daemon.stop();
}

/// Checks that a topic has the stamps and ranges of the readings with a range.
fn assert_ranges<'a>(
    reported: &Received,
    pings: &[&'a Value],
    topic: &str,
    received: impl Fn(&'a Value) -> &'a Value,
) {
    let expected: Vec<(i128, f32)> = pings
        .iter()
        .filter_map(|ping| {
            let fired: jiff::Timestamp = ping["time"].as_str()?.parse().expect("a time");
            let range = match received(ping)["status"].as_str()? {
                "echo" => received(ping)["range_m"].as_f64()? as f32,
                "no_echo" => f32::INFINITY,
                "min_range" => f32::NEG_INFINITY,
                _ => return None,
            };
            Some((fired.as_nanosecond(), range))
        })
        .collect();
    assert!(expected.len() > 30, "{topic}: {}", expected.len());
    let ranges: Vec<(i128, f32)> = reported.of(topic).map(|(_, bytes)| range_of(bytes)).collect();
    assert_eq!(ranges, expected, "{topic}");
}

#[test]
fn late_viewer_gets_the_last_scan() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &[]);
    daemon.wait_for("ready");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":2}"#).status, 202);
    daemon.wait_for_scans(2);
    // Messages are converted in a task of their own: until none is left.
    let mut early = Viewer::new(daemon.connect(), "foxglove.sdk.v1");
    early.wait_for_channels();
    early.subscribe_to_all();
    while early.receive_for(Duration::from_secs(1)).topics().any(|topic| topic == "/sonar/range") {}
    let mut late = Viewer::new(daemon.connect(), "foxglove.sdk.v1");
    late.wait_for_channels();
    late.subscribe_to_all();
    let reported = late.receive_for(Duration::from_secs(1));
    for topic in
        ["/tf", "/tf_static", "/sonar/scene", "/sonar/scan", "/sonar/points", "/sonar/paths"]
    {
        assert_eq!(reported.of(topic).count(), 1, "{topic}");
    }
    assert_eq!(reported.of("/sonar/range").count(), 0, "readings of before are over");
    // Another scan goes on from there.
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    let reported = late.until("/sonar/paths");
    assert!(reported.of("/sonar/range").count() > 30);
    daemon.stop();
    assert!(matches!(late.next(), None | Some(viewer::Came::End(1001))), "a close frame");
}

#[test]
fn topic_per_ranger() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start_array(folder.path(), &["--set", "foxglove.enabled=true"]);
    let mut viewer = Viewer::new(daemon.connect(), "foxglove.sdk.v1");
    viewer.wait_for_channels();
    viewer.subscribe_to_all();
    drop(viewer.until("/sonar/points"));
    let reported = viewer.until("/sonar/points");
    let topics: Vec<&str> = reported.topics().collect();
    let of_rangers = topics.iter().filter(|topic| topic.ends_with("/range")).count();
    assert_eq!(of_rangers, 8, "{topics:?}");
    assert!(!topics.contains(&"/sonar/scan") && !topics.contains(&"/sonar/range"), "{topics:?}");
    daemon.stop();
}
