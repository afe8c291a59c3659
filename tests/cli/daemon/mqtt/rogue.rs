//! Brokers that do not do their part.

use std::time::Duration;

use super::{
    super::Daemon,
    PLAN,
    broker::{Broker, Manner},
    mqtt, start, wait_for_trouble,
};
use crate::common::wait_until;

/// Duration of the observation of each broker.
const LOOK: Duration = Duration::from_secs(6);

/// Scans that a daemon completes within [`LOOK`] beside a broker, or without one.
fn beside(broker: Option<(Manner, &str)>) -> u64 {
    let folder = tempfile::tempdir().expect("a folder");
    let peer = broker.map(|(manner, _)| Broker::start(manner));
    let settings = peer.as_ref().map(|broker| broker.settings().to_vec()).unwrap_or_default();
    let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
    let mock = ["--mock", "--scene", "simple-room", "--pose", "fig9"];
    let busy = ["--set", "scanning.mode=continuous", "--set", "mqtt.queue_kb=64"];
    let daemon = Daemon::start(folder.path(), &[&mock, &settings[..], &PLAN, &busy].concat());
    daemon.wait_for_scans(5);
    if let Some((_, trouble)) = broker.filter(|(_, trouble)| !trouble.is_empty()) {
        wait_for_trouble(&daemon, trouble);
    }
    let scans = || daemon.health()["scans"]["completed"].as_u64().expect("a count");
    let before = scans();
    std::thread::sleep(LOOK);
    let completed = scans() - before;
    println!("{broker:?}: {completed} scans, {}", mqtt(&daemon));
    assert_eq!(daemon.stop(), Some(0));
    completed
}

#[test]
fn scans_are_not_delayed() {
    for (manner, trouble) in [
        (Manner::Honest, ""),
        (Manner::Deaf, ""),
        (Manner::Curt, "closed the connection"),
        (Manner::Garbled, "protocol error"),
        (Manner::Noisy, "messages per second"),
        (Manner::Pushy, "messages per second"),
        (Manner::Bulky, "protocol error"),
    ] {
        assert!(beside(Some((manner, trouble))) > 0, "{manner:?}");
    }
}

#[test]
fn attempts_back_off() {
    for manner in
        [Manner::Deaf, Manner::Curt, Manner::Garbled, Manner::Noisy, Manner::Pushy, Manner::Bulky]
    {
        let folder = tempfile::tempdir().expect("a folder");
        let broker = Broker::start(manner);
        let daemon = start(folder.path(), &broker, &[]);
        daemon.wait_for("ready");
        wait_until("a try", || {
            manner == Manner::Curt || !broker.received().introductions.is_empty()
        });
        std::thread::sleep(LOOK);
        let tries = broker.received().introductions.len();
        assert!(tries < 12, "{manner:?}: {tries} tries");
    }
}

#[test]
fn unacknowledged_are_resent() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Deaf);
    let daemon = start(folder.path(), &broker, &[]);
    daemon.wait_for("ready");
    super::take_scans(&daemon, 1);
    wait_until("some is sent", || mqtt(&daemon)["waiting"].as_u64() > Some(10));
    assert_eq!(mqtt(&daemon)["acknowledged"], 0);
    // Longer than the broker may be silent.
    std::thread::sleep(Duration::from_secs(25));
    wait_for_trouble(&daemon, "acknowledged nothing");
    broker.become_(Manner::Honest);
    wait_until("all", || mqtt(&daemon)["waiting"] == 0 && mqtt(&daemon)["connected"] == true);
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn rejected_credentials_in_status() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Refusing);
    let daemon = start(folder.path(), &broker, &["--set", "mqtt.user=somebody"]);
    wait_for_trouble(&daemon, "refuses user or password");
    assert_eq!(mqtt(&daemon)["connected"], false);
    assert_eq!(daemon.stop(), Some(0));
}
