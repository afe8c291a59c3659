//! Publication of a daemon's log through an MQTT broker, under faults of both; commands and cost.

mod broker;
mod commands;
mod refused;
mod rogue;

use std::{collections::BTreeMap, path::Path};

use serde_json::{Value, json};

use super::{Daemon, clean_log, write_token};
use crate::common::{Log, run, stderr, wait_until};
use broker::{Broker, Manner};

/// A small plan, taken faster than in real time.
const PLAN: [&str; 5] =
    ["--virtual-time", "--set", "model.max_range_m=3", "--set", "plan.to_deg=36"];

/// A daemon that sends to `broker`, of a small plan and faster than in real time.
fn start(folder: &Path, broker: &Broker, further: &[&str]) -> Daemon {
    let settings = broker.settings();
    let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
    Daemon::start_mock(folder, &[&settings[..], &PLAN, further].concat())
}

fn take_scans(daemon: &Daemon, scans: u64) {
    let before = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    assert_eq!(daemon.send("POST", "/v1/start", &json!({"scans": scans}).to_string()).status, 202);
    daemon.wait_for_scans(before + scans);
}

fn mqtt(daemon: &Daemon) -> Value {
    daemon.status()["mqtt"].clone()
}

fn wait_for_trouble(daemon: &Daemon, words: &str) {
    wait_until(words, || mqtt(daemon)["error"].as_str().is_some_and(|error| error.contains(words)));
}

/// Returns the identity of a record: scan and index.
fn name(record: &Value) -> String {
    match record["type"].as_str().expect("a type") {
        "ping" => format!("{} {}", record["scan"], record["index"]),
        kind @ ("scan_start" | "scan_end") => format!("{} {kind}", record["scan"]),
        _ => record.to_string(),
    }
}

/// The records that were published, each once. One that came twice came alike.
fn records(broker: &Broker) -> BTreeMap<String, Value> {
    let mut records = BTreeMap::new();
    for published in &broker.received().published {
        let kind = published.topic.strip_prefix("sonard/kiwi/").expect("its robot's");
        if matches!(kind, "online" | "status" | "answer") {
            continue;
        }
        let record: Value = serde_json::from_slice(&published.payload).expect("a record");
        assert_eq!(record["type"], kind);
        assert_eq!(published.is_retained, kind == "session");
        let before = records.insert(name(&record), record.clone());
        assert!(before.is_none_or(|before| before == record), "{record}");
    }
    records
}

fn logged(log: &Log) -> BTreeMap<String, Value> {
    log.records.iter().map(|record| (name(record), record.clone())).collect()
}

#[test]
fn records_and_presence() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Honest);
    let password = write_token(folder.path(), "secret word");
    let password = format!("mqtt.password_file={}", password.display());
    let keys = ["--set", "mqtt.user=robot-1", "--set", &password, "--set", "mqtt.keep_alive_s=7"];
    let daemon = start(folder.path(), &broker, &keys);
    daemon.wait_for("ready");
    take_scans(&daemon, 3);
    let log = || logged(&clean_log(folder.path()));
    wait_until("the records", || records(&broker).len() == log().len());
    assert_eq!(records(&broker), log());
    let count = Some(log().len() as u64);
    wait_until("acknowledgements", || mqtt(&daemon)["acknowledged"].as_u64() >= count);
    let report = mqtt(&daemon);
    assert_eq!((&report["connected"], &report["connections"]), (&json!(true), &json!(1)));
    assert_eq!((report["acknowledged"].as_u64(), &report["waiting"]), (count, &json!(0)));
    assert_eq!(report["error"], Value::Null);
    wait_until("the place", || mqtt(&daemon)["lag_bytes"] == 0);
    let metrics = String::from_utf8(daemon.get("/metrics").body).expect("text");
    assert!(metrics.contains("\nsonard_mqtt_connected 1"), "{metrics}");
    wait_until("the status", || !broker.of("sonard/kiwi/status").is_empty());
    let status: Value =
        serde_json::from_slice(&broker.of("sonard/kiwi/status")[0].payload).expect("it");
    assert_eq!(status["robot"], "kiwi");
    assert!(broker.of("sonard/kiwi/status")[0].is_retained);

    assert_eq!(daemon.stop(), Some(0));
    let online = broker.of("sonard/kiwi/online");
    let reported: Vec<_> =
        online.iter().map(|one| (one.payload.as_slice(), one.is_retained)).collect();
    assert_eq!(reported, [(&b"true"[..], true), (b"false", true)]);
    let received = broker.received();
    let [hello] = received.introductions.as_slice() else { panic!("{:?}", received.introductions) };
    let will = ("sonard/kiwi/online".to_owned(), b"false".to_vec(), true);
    assert_eq!((&hello.will, hello.id.as_str()), (&Some(will), "sonard-kiwi"));
    assert_eq!(
        (hello.user.as_deref(), hello.password.as_deref()),
        (Some("robot-1"), Some(&b"secret word"[..]))
    );
    assert_eq!((hello.keep_alive_s, hello.is_clean, received.goodbyes), (7, true, 1));
    assert!(received.subscriptions.is_empty(), "commands are off");
}

#[test]
fn backlog_after_outage_and_kill() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Curt);
    // A log for each scan, so that there are several to go through.
    let small = ["--set", "log.rotate_mb=0.01"];
    let daemon = start(folder.path(), &broker, &small);
    daemon.wait_for("ready");
    wait_for_trouble(&daemon, "closed the connection");
    take_scans(&daemon, 4);
    daemon.kill();
    // A scan that the daemon was killed in.
    let daemon = start(
        folder.path(),
        &broker,
        &[&small[..], &["--set", "scanning.mode=continuous"]].concat(),
    );
    daemon.wait_for_scans(2);
    daemon.kill();
    assert!(super::logs(folder.path()).len() > 2);
    // Each connection brings some more.
    broker.become_(Manner::Short(40));
    let daemon = start(folder.path(), &broker, &small);
    wait_until("some", || broker.received().published.len() > 100);
    daemon.kill();
    broker.become_(Manner::Honest);
    let daemon = start(folder.path(), &broker, &small);
    daemon.wait_for("ready");
    take_scans(&daemon, 1);
    let log = || logged(&clean_log(folder.path()));
    wait_until("all of them", || records(&broker).len() == log().len());
    assert_eq!(records(&broker), log());
    assert_eq!(daemon.stop(), Some(0));
    let published =
        broker.received().published.iter().filter(|one| one.topic.ends_with("/ping")).count();
    assert!(published > log().values().filter(|record| record["type"] == "ping").count());
}

#[test]
fn older_records_and_gaps() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Honest);
    let without = Daemon::start_mock(folder.path(), &["--virtual-time", "--set", "plan.to_deg=9"]);
    without.wait_for("ready");
    take_scans(&without, 1);
    assert_eq!(without.stop(), Some(0));
    let before = clean_log(folder.path()).records.len();
    let daemon = start(folder.path(), &broker, &[]);
    daemon.wait_for("ready");
    take_scans(&daemon, 1);
    assert_eq!(daemon.stop(), Some(0));
    let all = clean_log(folder.path()).records;
    assert_eq!(records(&broker).len(), all.len() - before);
    // The position file is removed: publication starts again.
    std::fs::remove_file(folder.path().join("log/mqtt-place.json")).expect("it is there");
    let daemon = start(folder.path(), &broker, &["--set", "mqtt.history=true"]);
    wait_until("all", || records(&broker).len() == clean_log(folder.path()).records.len());
    assert_eq!(daemon.stop(), Some(0));
    // Unsent logs are removed.
    for log in super::logs(folder.path()) {
        std::fs::remove_file(log).expect("it is there");
    }
    let daemon = start(folder.path(), &broker, &[]);
    daemon.wait_for("ready");
    wait_until("the report", || {
        let reported = clean_log(folder.path()).events().join("\n");
        reported.contains("gap") && reported.contains("which the broker has up to byte")
    });
    assert_eq!(daemon.stop(), Some(0));
    assert!(records(&broker).values().any(|record| record["kind"] == "gap"));
}

#[test]
fn wrong_settings() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "no certificate").expect("there is room");
    let file = file.display();
    let mock = ["run", "--mock", "--scene", "simple-room", "--pose", "fig9", "--log"];
    let log = folder.path().join("log");
    let socket = folder.path().join("s");
    for (settings, reported) in [
        (&["mqtt.broker=broker"][..], "mqtt://HOST:PORT"),
        (&["mqtt.broker=mqtt://b", "mqtt.topic=a/#"], "mqtt.topic"),
        (
            &["mqtt.broker=mqtt://b", "mqtt.user=u", &format!("mqtt.password_file={file}")],
            "chmod 600",
        ),
        (&["mqtt.broker=mqtts://b", &format!("mqtt.ca_file={file}")], "no certificate is in it"),
        (&["mqtt.broker=mqtts://b", "mqtt.ca_file=/no/such"], "mqtt.ca_file /no/such"),
        (&["mqtt.broker=mqtts://b", "mqtt.key_file=/k"], "give both"),
        (&["mqtt.broker=mqtt://b", "mqtt.queue_kb=8"], "16 to 32768"),
    ] {
        let mut arguments = mock.to_vec();
        arguments.push(log.to_str().expect("plain path"));
        arguments.extend(["--socket", socket.to_str().expect("plain path")]);
        arguments.extend(settings.iter().flat_map(|setting| ["--set", setting]));
        let refused = run(&arguments);
        assert_eq!(refused.status.code(), Some(2), "{settings:?}");
        assert!(stderr(&refused).contains(reported), "{settings:?}: {}", stderr(&refused));
    }
}
