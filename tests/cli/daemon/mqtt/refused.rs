//! Messages that a broker answers by closing the connection, and connections that it closes for another client.

use std::{thread, time::Duration};

use super::{
    broker::{Broker, Manner},
    clean_log, mqtt, records, start, take_scans, wait_for_trouble,
};
use crate::common::wait_until;

/// Types of the records that the broker has.
fn published(broker: &Broker) -> Vec<String> {
    records(broker).values().map(|record| record["type"].as_str().expect("a type").into()).collect()
}

/// Details of the events about omitted records, as logged.
fn gaps(folder: &std::path::Path) -> Vec<String> {
    let log = clean_log(folder);
    let gaps = log.of_type("event").filter(|event| event["kind"] == "gap");
    gaps.map(|event| event["detail"].as_str().expect("text").to_owned()).collect()
}

#[test]
fn too_large_record_is_skipped() {
    // The status fits.
    skip_sessions(4000);
}

#[test]
fn too_large_status_is_skipped() {
    skip_sessions(2000);
}

/// Publishes to a broker that takes no session, and compares what it has with the log.
fn skip_sessions(max_bytes: usize) {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Limited(max_bytes));
    // A session for each file of the log, and one above the limit in each.
    let settings = ["--set", "log.rotate_mb=0.01", "--set", "mqtt.status_s=1"];
    let daemon = start(folder.path(), &broker, &settings);
    daemon.wait_for("ready");
    let ends = || records(&broker).values().filter(|record| record["type"] == "scan_end").count();
    let publish_scans = |scans: u64, total: usize| {
        take_scans(&daemon, scans);
        wait_until("the other records", || ends() == total && mqtt(&daemon)["waiting"] == 0);
        wait_until("a connection", || mqtt(&daemon)["connected"] == true);
        mqtt(&daemon)
    };
    // The first session costs connections until the limit is known; later ones cost none.
    let first = publish_scans(1, 1);
    publish_scans(2, 3);
    // The report follows the broker with a delay.
    wait_until("dropped sessions", || mqtt(&daemon)["skipped"].as_u64() >= Some(2));
    let report = mqtt(&daemon);
    if max_bytes > 2000 {
        assert_eq!(report["connections"], first["connections"], "{report}");
    }
    wait_for_trouble(&daemon, "closes the connection at messages of");
    let of_records =
        |gaps: Vec<String>| gaps.into_iter().filter(|gap| gap.contains("a record for"));
    wait_until("events", || {
        of_records(gaps(folder.path())).count() as u64 == mqtt(&daemon)["skipped"]
    });
    let gaps = gaps(folder.path());
    let (session, status) = ("sonard/kiwi/session", "sonard/kiwi/status");
    assert!(gaps.iter().all(|gap| gap.contains(session) || gap.contains(status)), "{gaps:?}");
    assert!(daemon.messages().contains("max_packet_size"), "{}", daemon.messages());
    // The events about dropped messages are published, too.
    wait_until("all records but sessions", || {
        let had = records(&broker);
        let log = super::logged(&clean_log(folder.path()));
        let mut missing = log.iter().filter(|(name, _)| !had.contains_key(*name));
        missing.all(|(_, record)| record["type"] == "session")
    });
    if max_bytes <= 2000 {
        // Each smaller status costs a few connections, and then none.
        let connections = || mqtt(&daemon)["connections"].as_u64();
        let mut before = connections();
        wait_until("a lasting connection", || {
            thread::sleep(Duration::from_secs(5));
            let current = connections();
            std::mem::replace(&mut before, current) == current
        });
    }
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn forbidden_topic_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Denying("/scan_start"));
    let daemon = start(folder.path(), &broker, &[]);
    daemon.wait_for("ready");
    take_scans(&daemon, 2);
    let scans = || published(&broker).iter().filter(|kind| *kind == "scan_end").count();
    wait_until("the other records", || scans() == 2);
    wait_for_trouble(&daemon, "sonard/kiwi/scan_start");
    assert_eq!(mqtt(&daemon)["skipped"], 2);
    assert_eq!(gaps(folder.path()).len(), 1, "of a whole topic one event is enough");
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn stalled_broker_catches_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let broker = Broker::start(Manner::Denying(""));
    let daemon = start(folder.path(), &broker, &[]);
    daemon.wait_for("ready");
    take_scans(&daemon, 1);
    wait_for_trouble(&daemon, "permit this client to publish to sonard/kiwi/#");
    assert_eq!(mqtt(&daemon)["skipped"], 0);
    broker.become_(Manner::Honest);
    wait_until("all records", || {
        records(&broker).len() == super::logged(&clean_log(folder.path())).len()
    });
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn duplicate_client_id_backs_off() {
    let broker = Broker::start(Manner::Unique);
    let folders = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let daemons = folders.each_ref().map(|folder| start(folder.path(), &broker, &[]));
    // Each ends the other's connection, less and less often.
    thread::sleep(Duration::from_secs(10));
    let early = broker.received().introductions.len();
    thread::sleep(Duration::from_secs(10));
    let late = broker.received().introductions.len() - early;
    assert!(late < early && late <= 6, "{early} connections, then {late}");
    for daemon in &daemons {
        wait_for_trouble(daemon, "another client uses the id sonard-kiwi");
        assert_eq!(mqtt(daemon)["skipped"], 0);
    }
    for daemon in daemons {
        assert_eq!(daemon.stop(), Some(0));
    }
}
