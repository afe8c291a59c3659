//! A log that is removed, moved, truncated or replaced while the daemon writes it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sonard_test_support::in_process::Daemon;

use super::logs;
use crate::common::{Log, run};

/// A scanning daemon, and the log that it writes.
fn start(folder: &Path) -> (Daemon, PathBuf) {
    let settings = ["scanning.mode=continuous", "model.max_range_m=3", "plan.step_deg=9"];
    let further: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
    let daemon = Daemon::start_mock(folder, &further);
    daemon.wait_for_scans(1);
    daemon.wait_until("beams", || daemon.status()["scan"]["done"].as_u64() >= Some(5));
    let log = logs(folder).pop().expect("a log");
    (daemon, log)
}

/// Waits until the daemon reports the incident and scans again; returns its logs' records after the end.
fn recover(daemon: Daemon, incident: &str) -> Log {
    daemon.wait_until("the incident", || {
        let text = daemon.status()["log"]["incident"].to_string();
        text.contains(incident)
    });
    assert_eq!(daemon.get("/v1/health").status, 503);
    let scans = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    daemon.wait_for_scans(scans + 2);
    let status = daemon.status();
    let [written, synced, uncertain] =
        ["written", "synced", "uncertain"].map(|key| status["log"][key].as_u64().expect("a count"));
    assert!(synced + uncertain <= written, "{status}");
    let folder = daemon.folder.clone();
    daemon.stop();
    let mut text = String::new();
    for log in logs(&folder) {
        let verified = run(&["log", "verify", log.to_str().expect("plain path")]);
        let found = String::from_utf8_lossy(&verified.stdout).into_owned();
        assert_eq!(verified.status.code(), Some(0), "{}: {found}", log.display());
        text += &fs::read_to_string(&log).expect("readable");
    }
    Log::parse(&text)
}

/// Returns `true` if a gap event states the reason, in a file that begins with a session.
fn assert_gap(log: &Log, detail: &str) {
    let events = log.events();
    assert!(
        events.iter().any(|event| event.contains("gap") && event.contains(detail)),
        "{events:?}"
    );
    assert_eq!(log.records[0]["type"], "session");
}

#[test]
fn removed_log_is_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, log) = start(folder.path());
    fs::remove_file(&log).expect("it is there");
    let log = recover(daemon, "was removed");
    assert_gap(&log, "was removed");
    // The scan that was under way is whole in the new file.
    let scan = log.of_type("scan_start").next().expect("a scan")["scan"].clone();
    let pings = log.of_type("ping").filter(|ping| ping["scan"] == scan).count();
    let end = log.of_type("scan_end").find(|end| end["scan"] == scan).expect("its end");
    assert_eq!((pings as u64, end["missing"].as_u64()), (40, Some(0)));
}

#[test]
fn moved_log_is_completed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, log) = start(folder.path());
    let moved = folder.path().join("moved.jsonl");
    fs::rename(&log, &moved).expect("it is there");
    let log = recover(daemon, "moved or replaced");
    assert_gap(&log, "moved or replaced");
    let verified = run(&["log", "verify", moved.to_str().expect("plain path")]);
    let printed = String::from_utf8_lossy(&verified.stdout).into_owned();
    assert_eq!(verified.status.code(), Some(0), "{printed}");
    // The device's clock is simulated, that of events is not.
    let is_other =
        |line: &&str| line.contains("warning: ") && !line.contains("time goes backwards");
    assert_eq!(printed.lines().find(is_other), None);
    let moved = Log::read(&moved);
    assert_eq!(moved.of_type("scan_start").count(), moved.of_type("scan_end").count());
}

#[test]
fn removed_folder_is_created_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, _) = start(folder.path());
    fs::remove_dir_all(folder.path().join("log")).expect("it is there");
    assert_gap(&recover(daemon, "was removed"), "was removed");
}

#[test]
fn replaced_folder_gets_a_new_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, _) = start(folder.path());
    fs::rename(folder.path().join("log"), folder.path().join("old")).expect("it is there");
    fs::create_dir(folder.path().join("log")).expect("the name is free");
    assert_gap(&recover(daemon, "moved or replaced"), "moved or replaced");
    for entry in fs::read_dir(folder.path().join("old")).expect("a folder").flatten() {
        let verified = run(&["log", "verify", entry.path().to_str().expect("plain path")]);
        assert_eq!(verified.status.code(), Some(0));
    }
}

#[test]
fn truncated_log_is_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let (daemon, log) = start(folder.path());
    fs::write(&log, "").expect("it is there");
    let records = recover(daemon, "changed by another program");
    assert_gap(&records, "changed by another program");
    // The records that followed the truncation are in the new file only.
    assert!(!log.exists());
    let scan = records.of_type("scan_start").next().expect("a scan")["scan"].clone();
    assert_eq!(records.of_type("ping").filter(|ping| ping["scan"] == scan).count(), 40);
}
