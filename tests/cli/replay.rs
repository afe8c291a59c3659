//! `sonard mock --replay`: readings of a log, through the protocol.

use std::{fs, path::Path};

use serde_json::Value;

use crate::common::{
    Log, MockProcess,
    daemon::{Daemon, clean_log},
    mock_scan, run, stderr,
};

/// Scans with the port of a replay.
fn scan(replay: &MockProcess, out: &Path, further: &[&str]) -> Log {
    let (port, out) = (replay.port(), out.to_str().expect("plain"));
    let output = run(&[&["scan", "--port", port, "--out", out][..], further].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    Log::read(&Path::new(out).join("scan.jsonl"))
}

/// Readings of all scans, each scan in the order of its plan: a restart of the device changes that of
/// the log.
fn in_order(log: &Log) -> Vec<&Value> {
    let mut pings = log.pings();
    let scans: Vec<_> = log.of_type("scan_start").map(|start| &start["scan"]).collect();
    let place = |ping: &&Value| {
        let scan = scans.iter().position(|scan| **scan == ping["scan"]);
        (scan, ping["index"].as_u64())
    };
    pings.sort_by_key(place);
    pings
}

/// Azimuth, status and echo times of each reading.
fn readings(log: &Log) -> Vec<[Value; 3]> {
    let of =
        |ping: &&Value| ["azimuth_deg", "status", "echo_ticks"].map(|field| ping[field].clone());
    in_order(log).iter().map(of).collect()
}

/// Residuals of each reading, with its predicted range.
fn residuals(log: &Log) -> Vec<[Value; 2]> {
    let of = |ping: &&Value| [ping["sim"]["range_m"].clone(), ping["residual_m"].clone()];
    in_order(log).iter().map(of).collect()
}

const HERE: [&str; 4] = ["--scene", "simple-room", "--pose", "fig9"];

#[test]
fn measured_log_with_faults() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = folder.path().join("first");
    let noisy = ["--seed", "7", "--noise-mm", "4", "--faults", "flip=0.002,reset=0.004"];
    let measured = mock_scan("fig9", &first, &[&noisy[..], &["--to-deg", "90"]].concat());
    assert!(measured.status.success(), "{}", stderr(&measured));
    let log = first.join("scan.jsonl");
    let expected = Log::read(&log);
    let replay = MockProcess::replay(folder.path(), &log);
    let again =
        scan(&replay, &folder.path().join("again"), &[&HERE[..], &["--to-deg", "90"]].concat());
    assert_eq!(readings(&again), readings(&expected));
    assert_eq!(residuals(&again), residuals(&expected));
    let session = again.of_type("session").next().expect("a session");
    assert_eq!(
        (&session["provenance"], &session["device"]["serial"]),
        (&"replay".into(), &"REPLAY-001".into())
    );
    assert!(
        fs::read_to_string(folder.path().join("again/scan.svg"))
            .expect("drawn")
            .contains("REPLAY of an earlier log")
    );
}

#[test]
fn one_scan_after_another() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = folder.path().join("first");
    let two = ["--to-deg", "45", "--repeat", "2", "--noise-mm", "4"];
    assert!(mock_scan("fig9", &first, &two).status.success());
    let log = first.join("scan.jsonl");
    let replay = MockProcess::replay(folder.path(), &log);
    let out = folder.path().join("again");
    let again = scan(&replay, &out, &[&HERE[..], &["--to-deg", "45", "--repeat", "3"]].concat());
    let (expected, found) = (readings(&Log::read(&log)), readings(&again));
    assert_eq!((expected.len(), found.len()), (100, 150));
    assert_eq!((&found[..100], &found[100..]), (&expected[..], &expected[..50]));
    let (code, text) = replay.stop();
    assert_eq!(code, Some(0), "{text}");
    for part in ["2 scans, on a motor with 400 steps", "replaying scan 2 of 2", "--to-deg 45 "] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn imported_table() {
    let folder = tempfile::tempdir().expect("a folder");
    let (table, log) = (folder.path().join("room.csv"), folder.path().join("room.jsonl"));
    let rows = (0..36).map(|row| format!("{},{:.3}\n", 10 * row, 0.8 + 0.02 * f64::from(row)));
    fs::write(&table, format!("azimuth_deg,range_m\n{}", rows.collect::<String>()))
        .expect("there is room");
    let [from, to] = [&table, &log].map(|path| path.to_str().expect("plain"));
    let imported =
        run(&[&["import", from, "-o", to, "--sensor", "senscomp-6500"][..], &HERE].concat());
    assert!(imported.status.success(), "{}", stderr(&imported));
    let replay = MockProcess::replay(folder.path(), &log);
    let out = folder.path().join("again");
    let again = scan(&replay, &out, &[&HERE[..], &["--step-deg", "10"]].concat());
    let ranges = |log: &Log| {
        log.pings()
            .iter()
            .map(|ping| ping["range_m"].as_f64().expect("a range"))
            .collect::<Vec<_>>()
    };
    let (expected, found) = (ranges(&Log::read(&log)), ranges(&again));
    assert_eq!((expected.len(), found.len()), (36, 36));
    // Half a tick of 0.5 us is 0.043 mm of range.
    for (expected_m, found_m) in expected.iter().zip(&found) {
        assert!((expected_m - found_m).abs() < 0.05e-3, "{expected_m} {found_m}");
    }
    let compared = run(&["compare", out.join("scan.jsonl").to_str().expect("plain")]);
    assert!(String::from_utf8_lossy(&compared.stdout).starts_with(out.to_str().expect("plain")));
}

#[test]
fn daemon_logs_the_readings() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = folder.path().join("first");
    assert!(mock_scan("fig9", &first, &["--noise-mm", "4"]).status.success());
    let log = first.join("scan.jsonl");
    let replay = MockProcess::replay(folder.path(), &log);
    let port = replay.port().to_owned();
    let options = [&["--port", port.as_str()][..], &HERE].concat();
    let daemon = Daemon::start(folder.path(), &options);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans": 1}"#).status, 202);
    daemon.wait_for_scans(1);
    assert_eq!(daemon.stop(), Some(0));
    assert_eq!(readings(&clean_log(folder.path())), readings(&Log::read(&log)));
}

#[test]
fn rejected_logs() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("array.jsonl");
    let path = log.to_str().expect("plain");
    let array = ["simulate", "--scene", "mcgill-lab", "--pose", "fig4", "--array", "pioneer-8"];
    assert!(run(&[&array[..], &["-o", path]].concat()).status.success());
    let rejected = run(&["mock", "--replay", path]);
    assert_eq!(rejected.status.code(), Some(2));
    assert!(stderr(&rejected).contains("scan 1 is of an array"), "{}", stderr(&rejected));
    let both = run(&["mock", "--replay", path, "--noise-mm", "3"]);
    assert_eq!(both.status.code(), Some(2), "{}", stderr(&both));
    let neither = run(&["mock"]);
    assert!(stderr(&neither).contains("--scene"), "{}", stderr(&neither));
}
