//! `sonard report`: contents of the archive, the list before it, and its log in a replay.

use std::{fs, io::Read as _, path::Path};

use flate2::read::GzDecoder;

use crate::common::{
    Log, MockProcess,
    daemon::{Daemon, write_token},
    mock_scan, run, sonard, stderr,
};

/// Files of an archive, by name, with their text.
fn unpack(archive: &Path) -> Vec<(String, String)> {
    let mut archive = tar::Archive::new(GzDecoder::new(fs::File::open(archive).expect("written")));
    let entries = archive.entries().expect("an archive");
    let read = |entry: std::io::Result<tar::Entry<'_, _>>| {
        let mut entry = entry.expect("an entry");
        let name = entry.path().expect("a name").to_string_lossy().into_owned();
        let mut text = String::new();
        entry.read_to_string(&mut text).expect("UTF-8");
        (name.trim_start_matches("sonard-report/").to_owned(), text)
    };
    entries.map(read).collect()
}

fn text<'a>(files: &'a [(String, String)], name: &str) -> &'a str {
    let found = files.iter().find(|(known, _)| known == name);
    &found
        .unwrap_or_else(|| {
            panic!("{name}: {:?}", files.iter().map(|(name, _)| name).collect::<Vec<_>>())
        })
        .1
}

#[test]
fn daemon_log_and_ports() {
    let folder = tempfile::tempdir().expect("a folder");
    let token = write_token(folder.path(), "a-secret-token-of-this-test");
    let secret = format!("server.token_file={}", token.display());
    let daemon = Daemon::start_mock(folder.path(), &["--virtual-time", "--set", &secret]);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans": 1}"#).status, 202);
    daemon.wait_for_scans(1);
    let configuration = folder.path().join("sonard.toml");
    let server = format!(
        "[server]\nlisten = \"127.0.0.1:8765\"\ntoken_file = \"{}\"\n# hunter2\n",
        token.display()
    );
    fs::write(&configuration, server).expect("there is room");
    let [socket, archive, configuration] =
        [folder.path().join("s"), folder.path().join("report.tar.gz"), configuration]
            .map(|path| path.to_str().expect("plain").to_owned());
    let options = ["report", "--socket", &socket, "--config", &configuration, "-o", &archive];
    let output = run(&options);
    assert!(output.status.success(), "{}", stderr(&output));
    let listed = String::from_utf8(output.stdout).expect("UTF-8");
    let files = unpack(Path::new(&archive));
    for (name, _) in &files {
        assert!(listed.contains(name), "{name}: {listed}");
    }
    assert!(text(&files, "version.txt").starts_with("sonard "));
    assert!(text(&files, "configuration.toml").contains("listen = \"127.0.0.1:8765\""));
    assert!(text(&files, "status.json").contains("\"sonard\""));
    assert!(text(&files, "health.json").contains("\"healthy\""));
    assert!(text(&files, "system.txt").contains("Linux"));
    assert!(!text(&files, "ports.txt").is_empty() && !text(&files, "kernel.txt").is_empty());
    let log = files.iter().find(|(name, _)| name.starts_with("log-sonard-")).expect("a log");
    assert!(log.1.starts_with("{\"type\":\"session\""), "{}", log.1);
    for (name, text) in &files {
        for secret in ["a-secret-token", "hunter2"] {
            assert!(!text.contains(secret), "{secret} in {name}");
        }
    }
    // An existing file is kept.
    let again = run(&options);
    assert_eq!(again.status.code(), Some(2), "{}", stderr(&again));
    drop(daemon);
}

#[test]
fn nothing_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let absent = folder.path().join("absent").to_str().expect("plain").to_owned();
    let listed = sonard(&["report", "--list", "--socket", &absent])
        .current_dir(folder.path())
        .output()
        .expect("starts");
    assert!(listed.status.success(), "{}", stderr(&listed));
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0, "nothing is written");
    let report = ["report", "--socket", &absent, "--port", &absent];
    let output = sonard(&report).current_dir(folder.path()).output().expect("it starts");
    assert!(output.status.success(), "{}", stderr(&output));
    let archive =
        fs::read_dir(folder.path()).expect("a folder").next().expect("one").expect("a file").path();
    assert!(archive.to_string_lossy().contains("sonard-report-"), "{archive:?}");
    let files = unpack(&archive);
    assert!(text(&files, "status.txt").contains("no daemon responds"));
    assert!(text(&files, "doctor.json").contains("not_found"));
}

#[test]
fn log_of_a_report_is_replayed() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    assert!(mock_scan("fig9", &out, &["--to-deg", "9"]).status.success());
    let (log, archive) = (out.join("scan.jsonl"), folder.path().join("report.tar.gz"));
    let [log_path, archive_path] = [&log, &archive].map(|path| path.to_str().expect("plain"));
    let output = run(&["report", log_path, "-o", archive_path]);
    assert!(output.status.success(), "{}", stderr(&output));
    let reported = folder.path().join("reported.jsonl");
    fs::write(&reported, text(&unpack(&archive), "log-scan.jsonl")).expect("there is room");
    let replay = MockProcess::replay(folder.path(), &reported);
    let again = folder.path().join("again");
    let place = ["--scene", "simple-room", "--pose", "fig9", "--to-deg", "9"];
    let options = ["scan", "--port", replay.port(), "--out", again.to_str().expect("plain")];
    let scanned = run(&[&options[..], &place].concat());
    assert!(scanned.status.success(), "{}", stderr(&scanned));
    let ticks = |log: &Path| {
        Log::read(log).pings().iter().map(|ping| ping["echo_ticks"].clone()).collect::<Vec<_>>()
    };
    assert_eq!(ticks(&again.join("scan.jsonl")), ticks(&log));
}
