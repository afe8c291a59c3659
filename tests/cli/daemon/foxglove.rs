//! Foxglove's protocol: messages to viewers, access, and the cost of viewers.

mod access;
mod cost;
mod layout;
mod map;
mod viewer;

use std::time::Duration;

use serde_json::{Value, json};

use super::{Daemon, clean_log};
use viewer::{Received, Viewer, range_of};

/// A daemon with viewers, of a small plan.
fn start(folder: &std::path::Path, further: &[&str]) -> Daemon {
    let settings = [
        "foxglove.enabled=true",
        "model.max_range_m=3",
        "plan.to_deg=36",
        "motion.min_interval_ms=10",
    ];
    let settings: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
    Daemon::start_mock(folder, &[&settings, further].concat())
}

#[test]
fn readings_match_the_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &[]);
    daemon.wait_for("ready");
    let mut viewers = ["foxglove.sdk.v1", "foxglove.websocket.v1"].map(|protocol| {
        let mut viewer = Viewer::new(daemon.connect().expect("it listens"), protocol);
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
        let kept = viewer.for_a_while(Duration::from_millis(500));
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
    crate::common::wait_until("they left", || daemon.status()["subscribers"]["now"] == 0);
    assert_eq!(daemon.stop(), Some(0));
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
    let daemon = start(folder.path(), &["--virtual-time"]);
    daemon.wait_for("ready");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":2}"#).status, 202);
    daemon.wait_for_scans(2);
    // Messages are made beside all else: until there are no more.
    let mut early = Viewer::new(daemon.connect().expect("it listens"), "foxglove.sdk.v1");
    early.wait_for_channels();
    early.subscribe_to_all();
    while early.for_a_while(Duration::from_secs(1)).topics().any(|topic| topic == "/sonar/range") {}
    let mut late = Viewer::new(daemon.connect().expect("it listens"), "foxglove.sdk.v1");
    late.wait_for_channels();
    late.subscribe_to_all();
    let reported = late.for_a_while(Duration::from_secs(1));
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
    assert_eq!(daemon.stop(), Some(0));
    assert!(matches!(late.next(), None | Some(viewer::Came::End(1001))), "a close frame");
}

#[test]
fn topic_per_ranger() {
    let folder = tempfile::tempdir().expect("a folder");
    let array = ["--simulate", "--array", "pioneer-8", "--scene", "mcgill-lab", "--pose", "fig4"];
    let daemon =
        Daemon::start(folder.path(), &[&array[..], &["--set", "foxglove.enabled=true"]].concat());
    let mut viewer = Viewer::new(daemon.connect().expect("it listens"), "foxglove.sdk.v1");
    viewer.wait_for_channels();
    viewer.subscribe_to_all();
    drop(viewer.until("/sonar/points"));
    let reported = viewer.until("/sonar/points");
    let topics: Vec<&str> = reported.topics().collect();
    let of_rangers = topics.iter().filter(|topic| topic.ends_with("/range")).count();
    assert_eq!(of_rangers, 8, "{topics:?}");
    assert!(!topics.contains(&"/sonar/scan") && !topics.contains(&"/sonar/range"), "{topics:?}");
    assert_eq!(daemon.stop(), Some(0));
}
