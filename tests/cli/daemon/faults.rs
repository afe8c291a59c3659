//! Faults of port and disk: each is logged once and recovered from.

use std::time::Duration;

use serde_json::json;
use sonard::mock::Pace;
use sonard_test_support::in_process::Daemon as InProcess;

use super::{
    Daemon, clean_log, logs,
    rig::{self, Rig, limit_files},
};
use crate::common::wait_until;

/// A daemon that scans without end on a rig.
fn start(rig: &Rig, folder: &std::path::Path, further: &[&str]) -> Daemon {
    let options = rig.options();
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    Daemon::start(folder, &[&options[..], &["--set", "scanning.mode=continuous"], further].concat())
}

#[test]
fn unplugged_ranger() {
    let folder = tempfile::tempdir().expect("a folder");
    let continuous = ["--set", "scanning.mode=continuous"];
    let mut daemon = InProcess::start(folder.path(), &[&rig::OPTIONS[..], &continuous].concat());
    daemon.wait_for("absent");
    daemon.plug("", 1);
    daemon.wait_until("beams", || daemon.status()["scan"]["done"].as_u64() >= Some(3));
    daemon.unplug();
    daemon.wait_for("absent");
    wait_until("the message", || daemon.messages().matches("absent: ").count() == 2);
    // The absence is reported once.
    let printed = daemon.messages().lines().count();
    daemon.pass(Duration::from_secs(3));
    assert_eq!(daemon.messages().lines().count(), printed, "{}", daemon.messages());
    let status = daemon.status();
    assert!(status["link"]["retry_in_s"].as_f64().is_some_and(|wait_s| wait_s <= 0.4));
    assert!(
        status["link"]["error"].as_str().is_some_and(|t| t.contains("no serial port")),
        "{status}"
    );
    assert_eq!(daemon.get("/v1/health").status, 503);
    daemon.plug("", 2);
    daemon.wait_until("beams again", || daemon.status()["scan"]["done"].as_u64() >= Some(3));
    let health = daemon.health();
    assert_eq!((&health["line"]["losses"], &health["healthy"]), (&json!(1), &json!(true)));
    daemon.stop();
    let log = clean_log(folder.path());
    let events = log.events();
    let count = |what: &str| events.iter().filter(|event| event.contains(what)).count();
    assert_eq!(count("ready again"), 2, "{events:?}");
    assert_eq!(count("absent: "), 2, "{events:?}");
    // The interrupted scan lists its missing beams.
    let given_up = log.of_type("scan_end").next().expect("an end");
    assert_eq!(
        given_up["missing"].as_u64().map(|m| m + given_up["beams"].as_u64().unwrap_or(0)),
        Some(400)
    );
}

#[test]
fn port_and_device_faults() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::Virtual);
    rig.plug("version=9", 1);
    let daemon = start(&rig, folder.path(), &[]);
    daemon.wait_for("wrong_firmware");
    assert!(daemon.status()["link"]["error"].as_str().is_some_and(|t| t.contains("protocol 9")));
    let silent = rig.plug_silent();
    daemon.wait_for("not_answering");
    drop(silent);
    let busy = rig.plug_busy();
    daemon.wait_for("busy");
    assert!(daemon.status()["link"]["error"].as_str().is_some_and(|t| t.contains("fuser")));
    drop(busy);
    std::fs::write(folder.path().join("ranger"), "a file").expect("the name is free");
    daemon.wait_for("forbidden");
    std::fs::remove_file(folder.path().join("ranger")).expect("it is there");
    rig.plug("", 2);
    daemon.wait_for_scans(1);
    assert_eq!(daemon.stop(), Some(0));
    clean_log(folder.path());
}

#[test]
fn other_ranger_is_rejected() {
    let folder = tempfile::tempdir().expect("a folder");
    let serial = ["--set", "device.serial=SONARD-0007"];
    let mut daemon = InProcess::start(folder.path(), &[&rig::OPTIONS[..], &serial].concat());
    daemon.plug("", 1);
    daemon.wait_for("wrong_device");
    let trouble = daemon.status()["link"]["error"].clone();
    assert!(
        trouble.as_str().is_some_and(|t| t.contains("MOCK-00001") && t.contains("SONARD-0007")),
        "{trouble}"
    );
    assert_eq!(daemon.health()["scans"]["beams"], 0, "it was not moved");
}

#[test]
fn full_disk() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::Virtual);
    rig.plug("", 1);
    let daemon = start(&rig, folder.path(), &["--set", "log.daily=false"]);
    daemon.wait_for_scans(1);
    let size = std::fs::metadata(&logs(folder.path())[0]).expect("a log").len();
    limit_files(daemon.id(), Some(size + 20_000));
    wait_until("the disk to be full", || daemon.status()["log"]["error"].is_string());
    let error = daemon.status()["log"]["error"].clone();
    assert!(error.as_str().is_some_and(|error| error.contains("file-size limit")), "{error}");
    daemon.wait_for("ready");
    let beams = daemon.health()["scans"]["beams"].clone();
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(daemon.health()["scans"]["beams"], beams, "it does not measure in vain");
    limit_files(daemon.id(), None);
    wait_until("room", || daemon.status()["log"]["error"].is_null());
    let scans = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    daemon.wait_for_scans(scans + 1);
    assert_eq!(daemon.stop(), Some(0));
    let log = clean_log(folder.path());
    // Each scan has its end, and each end counts what is there.
    assert_eq!(log.of_type("scan_start").count(), log.of_type("scan_end").count());
    assert!(log.events().iter().any(|event| event.contains("log can't be written")));
}
