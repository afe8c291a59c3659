//! Disks whose syncs fail, hang or are missing.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
    time::{Duration, Instant},
};

use super::{Daemon, clean_log, logs};
use crate::common::{run, sonard, wait_until};

const SCANNING: [&str; 8] = [
    "--set",
    "scanning.mode=continuous",
    "--set",
    "model.max_range_m=3",
    "--set",
    "plan.step_deg=9",
    "--set",
    "log.sync_s=0.5",
];

/// The library that is preloaded, compiled once.
pub(super) fn faulty_disk() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let library = folder.join(format!("faulty_disk-{}.so", std::process::id()));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/faulty_disk.c");
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-o"]).arg(&library).arg(source).arg("-ldl");
        assert!(compiler.status().expect("a C compiler").success());
        library
    })
}

/// A command whose disk has the faults that are set in `faults`.
pub(super) fn on_faulty_disk(mut command: Command, faults: &Path) -> Command {
    fs::create_dir_all(faults).expect("a folder");
    command.env("LD_PRELOAD", faulty_disk()).env("FAULTY_DISK", faults);
    command
}

fn start(folder: &Path) -> Daemon {
    let command = on_faulty_disk(sonard(&[]), &folder.join("faults"));
    let mock = ["--mock", "--scene", "simple-room", "--pose", "fig9"];
    let daemon = Daemon::start_as(command, folder, &[&mock[..], &SCANNING].concat());
    daemon.wait_for_scans(1);
    daemon
}

fn set(folder: &Path, fault: &str, is_set: bool) {
    let path = folder.join("faults").join(fault);
    if is_set {
        fs::write(path, "").expect("there is room");
    } else {
        fs::remove_file(path).expect("it is set");
    }
}

#[test]
fn failed_sync_starts_a_new_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path());
    set(folder.path(), "eio", true);
    wait_until("the error", || daemon.status()["log"]["error"].is_string());
    let status = daemon.status();
    assert!(status["log"]["uncertain"].as_u64() > Some(0), "{status}");
    let reports = |daemon: &Daemon| daemon.messages().matches("scanning is paused").count();
    wait_until("the report", || reports(&daemon) > 0);
    // Another try neither succeeds nor leaves a file.
    std::thread::sleep(Duration::from_secs(1));
    assert!(daemon.status()["log"]["error"].is_string());
    assert_eq!(logs(folder.path()).len(), 1);
    assert_eq!(reports(&daemon), 1, "{}", daemon.messages());
    set(folder.path(), "eio", false);
    wait_until("recovery", || daemon.status()["log"]["error"].is_null());
    let scans = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    daemon.wait_for_scans(scans + 1);
    let status = daemon.status();
    let [written, synced, uncertain] =
        ["written", "synced", "uncertain"].map(|key| status["log"][key].as_u64().expect("a count"));
    assert!(synced + uncertain <= written, "{status}");
    assert_eq!(daemon.stop(), Some(0));
    assert_eq!(logs(folder.path()).len(), 2);
    let log = clean_log(folder.path());
    let events = log.events();
    assert!(events.iter().any(|event| event.contains("may not be on the disk")), "{events:?}");
}

#[test]
fn hanging_sync() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path());
    set(folder.path(), "slow", true);
    wait_until("the report", || daemon.status()["log"]["busy_s"].as_f64() >= Some(5.0));
    let health = daemon.get("/v1/health");
    assert_eq!(health.status, 503);
    assert!(health.json()["reasons"].to_string().contains("does not respond"));
    // Scanning goes on: few records wait.
    let scans = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    daemon.wait_for_scans(scans + 1);
    let since = Instant::now();
    let faults = folder.path().to_owned();
    let mut daemon = daemon;
    daemon.signal(rustix::process::Signal::TERM);
    let code = daemon.wait();
    assert_eq!(code, Some(3), "{}", daemon.messages());
    assert!(since.elapsed() < Duration::from_secs(40), "longer than the unit allows");
    assert!(daemon.messages().contains("not synced"), "{}", daemon.messages());
    set(&faults, "slow", false);
    clean_log(folder.path());
}

#[test]
fn missing_folder_sync_is_a_warning() {
    let folder = tempfile::tempdir().expect("a folder");
    let faults = folder.path().join("faults");
    fs::create_dir_all(&faults).expect("a folder");
    set(folder.path(), "nodirsync", true);
    let daemon = start(folder.path());
    wait_until("the warning", || daemon.messages().contains("cannot sync folders"));
    assert_eq!(daemon.stop(), Some(0));
    clean_log(folder.path());
    for verb in ["scan", "simulate"] {
        let out = folder.path().join(verb);
        let mut command = on_faulty_disk(sonard(&[verb]), &faults);
        command.args(["--scene", "simple-room", "--pose", "fig9", "--step-deg", "36"]);
        match verb {
            "scan" => command.args(["--mock", "--max-range", "3", "--out"]).arg(&out),
            _ => command.arg("-o").arg(&out),
        };
        let output = command.output().expect("it starts");
        let printed = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{verb}: {printed}");
        assert!(printed.contains("cannot sync folders"), "{verb}: {printed}");
        let log = if verb == "scan" { out.join("scan.jsonl") } else { out };
        let verified = run(&["log", "verify", log.to_str().expect("plain path")]);
        assert_eq!(verified.status.code(), Some(0), "{verb}");
    }
}
