//! Scans that are started and stopped through the broker.

use serde_json::{Value, json};

use super::{
    super::{Daemon, clean_log},
    broker::{Broker, Manner},
    mqtt, start, take_scans,
};
use crate::common::wait_until;

const RETAINED: u8 = 1;
const REPEATED: u8 = 8;

/// A daemon that takes commands.
fn commanded(folder: &std::path::Path, broker: &Broker) -> Daemon {
    let daemon = start(folder, broker, &["--set", "mqtt.commands=true"]);
    daemon.wait_for("ready");
    wait_until("it listens", || broker.received().subscriptions == ["sonard/kiwi/command/+"]);
    daemon
}

/// Publishes a command and returns the answer.
fn send_request(broker: &Broker, command: &str, body: &[u8], flags: u8) -> Value {
    let answers = || broker.of("sonard/kiwi/answer");
    let before = answers().len();
    broker.publish(&format!("sonard/kiwi/command/{command}"), body, flags);
    wait_until("an answer", || answers().len() > before);
    assert!(!answers()[before].is_retained);
    serde_json::from_slice(&answers()[before].payload).expect("JSON")
}

#[test]
fn start_and_stop() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Honest);
    let daemon = commanded(folder.path(), &broker);
    let body = br#"{"scans": 2, "plan": {"from_deg": 0, "to_deg": 9, "step_deg": 0.9, "pings_per_stop": 1}}"#;
    let answer = send_request(&broker, "start", body, 0);
    assert_eq!((&answer["command"], &answer["accepted"]), (&json!("start"), &json!(true)));
    daemon.wait_for_scans(2);
    let log = clean_log(folder.path());
    let starts: Vec<_> = log.of_type("scan_start").map(|start| &start["request"]).collect();
    assert_eq!(starts, [&answer["request"]; 2]);
    let stopped = send_request(&broker, "stop", b"", 0);
    assert_eq!(stopped, json!({"command": "stop", "accepted": true}));
    wait_until("it is counted", || mqtt(&daemon)["commands"] == 2);
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn rejected_and_repeated_commands() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Honest);
    let daemon = commanded(folder.path(), &broker);
    let huge = vec![b' '; 30_000];
    for (command, body, flags, reported) in [
        ("start", &b"{\"scans\": 0}"[..], 0, "scans is 0"),
        ("start", b"{\"scan\": 1}", 0, "unknown field"),
        ("start", b"{\"pose\": {\"x_m\": 99, \"y_m\": 0, \"heading_deg\": 0}}", 0, "outside"),
        ("start", b"\x00\xff", 0, "can't be read"),
        ("start", &huge, 0, "30000 bytes"),
        ("start", b"{}", RETAINED, "retained"),
        ("start", b"{}", REPEATED, "repetition"),
        ("reboot", b"", 0, "no such command"),
    ] {
        let answer = send_request(&broker, command, body, flags);
        assert_eq!((&answer["command"], &answer["accepted"]), (&json!(command), &json!(false)));
        let error = answer["error"].as_str().expect("words");
        assert!(error.contains(reported), "{command} {reported}: {error}");
        assert!(answer["help"].is_string());
    }
    assert_eq!(daemon.health()["scans"]["completed"], 0);
    wait_until("they are counted", || mqtt(&daemon)["rejected"] == 8);
    // A burst costs the connection at most, and the daemon goes on.
    for _ in 0..90 {
        broker.publish("sonard/kiwi/command/stop", b"", 0);
    }
    let taken = || mqtt(&daemon)["commands"].as_u64().expect("a count");
    let mut before = u64::MAX;
    while std::mem::replace(&mut before, taken()) != taken() {
        std::thread::sleep(std::time::Duration::from_secs(2));
    }
    assert!((1..=90).contains(&before));
    take_scans(&daemon, 1);
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn commands_disabled() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Honest);
    let daemon = start(folder.path(), &broker, &[]);
    daemon.wait_for("ready");
    wait_until("it is there", || mqtt(&daemon)["connected"] == true);
    broker.publish("sonard/kiwi/command/start", b"{}", 0);
    take_scans(&daemon, 1);
    assert_eq!(daemon.health()["scans"]["completed"], 1);
    assert!(broker.of("sonard/kiwi/answer").is_empty());
    assert_eq!(daemon.stop(), Some(0));
}
