//! Brokers that do not do their part.

use std::time::{Duration, Instant};

use super::{
    super::{Daemon, own_kb},
    PLAN,
    broker::{Broker, Manner},
    mqtt, start, wait_for_trouble,
};
use crate::common::{cpu_s, sonard, wait_until};

/// How long each is looked at.
const LOOK: Duration = Duration::from_secs(6);

/// What a daemon that scans as fast as it can measures and uses beside a broker, or without one: scans and memory
/// (kilobytes). Its threads take memory from one place: otherwise glibc gives each a place of its own, and what they
/// come to differs from run to run by more than any broker costs.
fn beside(broker: Option<(Manner, &str)>) -> (u64, u64) {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = sonard(&[]);
    command.env("MALLOC_ARENA_MAX", "1");
    let peer = broker.map(|(manner, _)| Broker::start(manner));
    let settings = peer.as_ref().map(|broker| broker.settings().to_vec()).unwrap_or_default();
    let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
    let mock = ["--mock", "--scene", "simple-room", "--pose", "fig9"];
    let busy = ["--set", "scanning.mode=continuous", "--set", "mqtt.queue_kb=64"];
    let daemon =
        Daemon::start_as(command, folder.path(), &[&mock, &settings[..], &PLAN, &busy].concat());
    daemon.wait_for_scans(5);
    if let Some((_, trouble)) = broker.filter(|(_, trouble)| !trouble.is_empty()) {
        wait_for_trouble(&daemon, trouble);
    }
    let scans = || daemon.health()["scans"]["completed"].as_u64().expect("a count");
    let (before, until) = (scans(), Instant::now() + LOOK);
    let mut most_kb = 0;
    while Instant::now() < until {
        most_kb = most_kb.max(own_kb(daemon.id()));
        std::thread::sleep(Duration::from_millis(50));
    }
    let taken = scans() - before;
    println!("{broker:?}: {taken} scans, {most_kb} kB, {}", mqtt(&daemon));
    assert_eq!(daemon.stop(), Some(0));
    (taken, most_kb)
}

#[test]
fn none_costs_memory_or_holds_up_a_scan() {
    let (alone, alone_kb) = beside(None);
    for (manner, trouble) in [
        (Manner::Honest, ""),
        (Manner::Deaf, ""),
        (Manner::Curt, "closed the connection"),
        (Manner::Garbled, "makes no sense"),
        (Manner::Noisy, "messages a second"),
        (Manner::Pushy, "messages a second"),
        (Manner::Bulky, "makes no sense"),
    ] {
        let (taken, kb) = beside(Some((manner, trouble)));
        assert!(taken * 4 > alone, "{manner:?}: {taken} scans, {alone} without a broker");
        // What may be under way, a packet that is read, and what a connection has.
        assert!(kb < alone_kb + 4096, "{manner:?}: {kb} kB, {alone_kb} without a broker");
    }
}

#[test]
fn none_keeps_an_idle_daemon_busy() {
    for manner in
        [Manner::Deaf, Manner::Curt, Manner::Garbled, Manner::Noisy, Manner::Pushy, Manner::Bulky]
    {
        let folder = tempfile::tempdir().expect("a folder");
        let broker = Broker::start(manner);
        let daemon = start(folder.path(), &broker, &[]);
        daemon.wait_for("ready");
        wait_until("a try", || manner == Manner::Curt || !broker.heard().introductions.is_empty());
        let (before, since) = (cpu_s(daemon.id()), Instant::now());
        std::thread::sleep(LOOK);
        let share = (cpu_s(daemon.id()) - before) / since.elapsed().as_secs_f64();
        println!("{manner:?}: {:.1} % of a core", 100.0 * share);
        assert!(share < 0.05, "{manner:?}: {share}");
        let tries = broker.heard().introductions.len();
        assert!(tries < 12, "{manner:?}: {tries} tries");
    }
}

#[test]
fn a_deaf_one_is_left_and_what_it_did_not_acknowledge_is_sent_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Deaf);
    let daemon = start(folder.path(), &broker, &[]);
    daemon.wait_for("ready");
    super::take_scans(&daemon, 1);
    wait_until("some is sent", || mqtt(&daemon)["waiting"].as_u64() > Some(10));
    assert_eq!(mqtt(&daemon)["acknowledged"], 0);
    // Longer than it may be deaf.
    std::thread::sleep(Duration::from_secs(25));
    wait_for_trouble(&daemon, "acknowledged nothing");
    broker.become_(Manner::Honest);
    wait_until("all", || mqtt(&daemon)["waiting"] == 0 && mqtt(&daemon)["connected"] == true);
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn one_that_refuses_user_or_password_is_told_in_the_status() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Refusing);
    let daemon = start(folder.path(), &broker, &["--set", "mqtt.user=somebody"]);
    wait_for_trouble(&daemon, "refuses user or password");
    assert_eq!(mqtt(&daemon)["connected"], false);
    assert_eq!(daemon.stop(), Some(0));
}
