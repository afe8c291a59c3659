//! `sonard status` and `sonard watch`.

use super::*;

#[test]
fn status_and_watch() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &SHORT);
    daemon.wait_for("ready");
    let socket = folder.path().join("s").display().to_string();
    let status = run(&["status", "--socket", &socket]);
    assert_eq!(status.status.code(), Some(0), "{}", stderr(&status));
    let screen = String::from_utf8_lossy(&status.stdout).into_owned();
    assert!(screen.starts_with("ready for ") && screen.contains("MOCK-00001"), "{screen}");
    let json = run(&["status", "--socket", &socket, "--json"]);
    let json: Value = serde_json::from_slice(&json.stdout).expect("one object");
    assert_eq!(json["status"]["link"]["state"], "ready");

    let watching = crate::common::sonard(&["watch", "--socket", &socket, "--json"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("starts");
    wait_until("the subscriber", || daemon.status()["subscribers"]["now"] == 1);
    daemon.send("POST", "/v1/start", r#"{"scans":1}"#);
    daemon.wait_for_scans(1);
    assert_eq!(daemon.stop(), Some(0));
    // It ends with the daemon, and its exit code differs from that of a requested end.
    let watched = watching.wait_with_output().expect("it ends");
    assert_eq!(watched.status.code(), Some(3));
    assert!(stderr(&watched).contains("--reconnect"), "{}", stderr(&watched));
    let text = String::from_utf8(watched.stdout).expect("text");
    let log = crate::common::Log::parse(&text);
    log.assert_each_beam_once(20);
    assert_eq!(log.of_type("scan_end").count(), 1);
    let gone = run(&["status", "--socket", &socket]);
    assert_eq!(gone.status.code(), Some(3));
    assert!(stderr(&gone).contains("sonard run"), "{}", stderr(&gone));
}

#[test]
fn watch_reconnects() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &SHORT);
    let socket = folder.path().join("s").display().to_string();
    let watching = crate::common::sonard(&["watch", "--socket", &socket, "--json", "--reconnect"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("starts");
    wait_until("the subscriber", || daemon.status()["subscribers"]["now"] == 1);
    daemon.kill();
    let daemon = Daemon::start_mock(folder.path(), &SHORT);
    wait_until("the subscriber again", || daemon.status()["subscribers"]["now"] == 1);
    daemon.wait_for("ready");
    daemon.send("POST", "/v1/start", r#"{"scans":1}"#);
    daemon.wait_for_scans(1);
    // Its queue is empty before it is interrupted.
    std::thread::sleep(Duration::from_millis(500));
    crate::common::interrupt(watching.id());
    let watched = watching.wait_with_output().expect("it ends");
    assert_eq!(watched.status.code(), Some(0));
    let log = crate::common::Log::parse(&String::from_utf8(watched.stdout).expect("text"));
    log.assert_each_beam_once(20);
}
