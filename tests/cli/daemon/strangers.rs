//! Devices that restart, are replaced, or report impossible values.

use std::collections::BTreeSet;

use serde_json::Value;
use sonard_test_support::{in_process::Daemon, rig};

use super::clean_log;
use crate::common::Log;

/// A continuously scanning daemon with a board that has faults.
fn start(folder: &std::path::Path, faults: &str, further: &[&str]) -> Daemon {
    let options = [&rig::OPTIONS[..], &["--set", "scanning.mode=continuous"], further].concat();
    let mut daemon = Daemon::start(folder, &options);
    daemon.plug(faults, 1);
    daemon
}

/// Checks each reading against its session; returns the kinds of sessions that had
/// readings, by serial, provenance and steps a revolution.
fn sessions_of_readings(log: &Log) -> BTreeSet<String> {
    let mut session = &Value::Null;
    let mut kinds = BTreeSet::new();
    for record in &log.records {
        match record["type"].as_str() {
            Some("session") => session = record,
            Some("ping") if record["status"] != "link_lost" => {
                let device = &session["device"];
                let steps = device["steps_per_revolution"].as_f64().expect("steps");
                let azimuth_deg = record["azimuth_deg"].as_f64().expect("an azimuth");
                let turned_deg = record["step"].as_f64().expect("a step") * 360.0 / steps;
                assert!((azimuth_deg - turned_deg).abs() < 1e-9, "{record} in {device}");
                kinds.insert(format!(
                    "{} {} {steps}",
                    device["serial"].as_str().expect("a serial"),
                    session["provenance"].as_str().expect("a provenance")
                ));
            }
            _ => {}
        }
    }
    kinds
}

#[test]
fn changed_board_starts_a_session() {
    for (lie, kind, printed) in [
        ("other-steps", "MOCK-00001 mock 800", "800 steps per revolution, not 400"),
        ("other-serial", "OTHER-0002 mock 400", "OTHER-0002, not MOCK-00001"),
        ("emulator", "MOCK-00001 emulator 400", "-SIMULATED"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let faults = format!("reset=0.01,lie={lie}");
        let daemon = start(folder.path(), &faults, &["--set", "plan.step_deg=1.8"]);
        daemon.wait_until("scans", || daemon.health()["scans"]["completed"].as_u64() >= Some(3));
        daemon.stop();
        let log = clean_log(folder.path());
        let kinds = sessions_of_readings(&log);
        let first = "MOCK-00001 mock 400".to_owned();
        assert_eq!(kinds, BTreeSet::from([first, kind.to_owned()]), "{lie}");
        assert!(log.events().iter().any(|event| event.contains(printed)), "{:?}", log.events());
    }
}

#[test]
fn named_board_is_required() {
    let folder = tempfile::tempdir().expect("a folder");
    let serial = ["--set", "device.serial=MOCK-00001"];
    let daemon = start(folder.path(), "reset=0.01,lie=other-serial", &serial);
    daemon.wait_for("wrong_device");
    daemon.wait_until("the name", || {
        let trouble = daemon.status()["link"]["error"].clone();
        trouble.as_str().is_some_and(|trouble| trouble.contains("expected MOCK-00001"))
    });
    daemon.pass(std::time::Duration::from_secs(1));
    daemon.stop();
    let kinds = sessions_of_readings(&clean_log(folder.path()));
    assert_eq!(kinds, BTreeSet::from(["MOCK-00001 mock 400".to_owned()]));
}

#[test]
fn restart_while_homing() {
    for faults in ["motor_reset=0.2", "motor_hangup=0.2"] {
        let folder = tempfile::tempdir().expect("a folder");
        // One beam at home: the motor only ever goes home, before and after.
        let daemon = start(folder.path(), faults, &["--set", "plan.to_deg=0.9"]);
        daemon.wait_until("scans", || daemon.health()["scans"]["completed"].as_u64() >= Some(20));
        daemon.stop();
        let log = clean_log(folder.path());
        let events = log.events();
        assert!(events.iter().any(|event| event.contains("could not go home")), "{events:?}");
        for nonsense in ["identified", "configured", "fault of the program"] {
            let found = events
                .iter()
                .find(|event| event.contains(nonsense) && !event.contains("ready again"));
            assert_eq!(found, None, "{faults}");
        }
        let empty = log.of_type("scan_end").filter(|end| end["beams"] == 0).count();
        let begun = log.of_type("scan_start").count();
        // What its own Home failed at is the only reason for an empty scan: one in five, and not also one
        // for each Home that failed before it. The last one may have been stopped with the daemon.
        let has_reason = |event: &&String| {
            event.contains("scan failed") || event.contains("the daemon is stopping")
        };
        let reasons = events.iter().filter(has_reason).count();
        assert!(empty <= reasons, "{faults}: {empty} empty scans: {events:?}");
        assert!(
            empty * 10 <= begun * 4,
            "{faults}: {empty} of {begun} scans are empty: {events:?}"
        );
    }
}
