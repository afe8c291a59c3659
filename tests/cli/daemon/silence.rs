//! Streams in which nothing happens, and daemons that have stopped without closing their connections.

use std::{
    io::{BufRead as _, BufReader, Read as _, Write as _},
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use rustix::process::Signal;
use sonard::client::IDLE_TIMEOUT;
use sonard_test_support::in_process::Daemon as InProcess;

use super::Daemon;
use crate::common::{sonard, wait_until};

/// A client has detected a daemon's silence by then.
const DETECTED: Duration = Duration::from_secs(60);

fn start(mut command: Command) -> Child {
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts")
}

/// Returns the output of a process, which must end within the time.
fn ended(child: Child, within: Duration) -> Output {
    let (id, since) = (child.id(), Instant::now());
    let waiting = thread::spawn(move || child.wait_with_output().expect("it ends"));
    while !waiting.is_finished() {
        if since.elapsed() > within {
            crate::common::interrupt(id);
            let output = waiting.join().expect("no panic");
            panic!("it runs after {within:?}: {}", String::from_utf8_lossy(&output.stderr));
        }
        thread::sleep(Duration::from_millis(50));
    }
    waiting.join().expect("no panic")
}

#[test]
fn keep_alive_lines() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &[]);
    daemon.wait_for("ready");
    for path in ["/v1/live/records", "/v1/live/scans"] {
        let mut stream = daemon.connect();
        // A client takes a daemon that sends nothing for as long for hung.
        stream.set_read_timeout(IDLE_TIMEOUT);
        let request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n");
        stream.write_all(request.as_bytes()).expect("it listens");
        let mut lines = BufReader::new(stream).lines().map(|line| line.expect("in time"));
        assert!(lines.by_ref().any(|line| line.is_empty()), "the head ends");
        for _ in 0..3 {
            // A chunk of one byte, the newline.
            assert_eq!(lines.next().as_deref(), Some("1"));
            assert_eq!(lines.next().as_deref(), Some(""));
            assert_eq!(lines.next().as_deref(), Some(""));
        }
    }
    daemon.stop();
}

#[test]
fn hanging_daemon_is_detected() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = ["--set", "scanning.mode=continuous", "--set", "model.max_range_m=3"];
    let daemon = Daemon::start_mock(folder.path(), &plan);
    daemon.wait_for_scans(1);
    let by_socket = |arguments: &[&str]| {
        let mut command = sonard(arguments);
        command.arg("--socket").arg(folder.path().join("s"));
        command
    };
    let watch = start(by_socket(&["watch"]));
    let mut several = by_socket(&["watch"]);
    several.arg("--socket").arg(folder.path().join("other"));
    let mut several = start(several);
    let mut patient = start(by_socket(&["watch", "--reconnect"]));
    let place = ["scan", "--daemon", "--scene", "simple-room", "--pose", "fig9"];
    let scan = start(by_socket(&[&place[..], &["--repeat", "50"]].concat()));
    let mut lines = BufReader::new(patient.stdout.take().expect("piped")).lines();
    lines.next().expect("a line").expect("text");
    wait_until("the scans", || daemon.status()["scanning"]["requested"].as_u64() > Some(0));
    thread::sleep(Duration::from_secs(1));
    daemon.signal(Signal::STOP);
    for (child, what) in [(watch, "watch"), (scan, "scan")] {
        let output = ended(child, DETECTED);
        let printed = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{what}: {printed}");
        let words = printed.replace("\n  │ ", " ").replace('\n', " ");
        // Between two scans the client polls the daemon.
        let reported = ["no data from the daemon for 40 s", "did not respond within 10 s"];
        assert!(reported.iter().any(|reported| words.contains(reported)), "{what}: {printed}");
    }
    daemon.signal(Signal::CONT);
    // What it had measured before comes first.
    let mut news = BufReader::new(patient.stderr.take().expect("piped")).lines();
    let mut received =
        |words: &str| news.by_ref().map_while(Result::ok).any(|line| line.contains(words));
    assert!(received("no data from the daemon for 40 s"));
    assert!(received("reconnected"));
    lines.next().expect("it goes on").expect("text");
    several.kill().expect("it runs");
    let mut printed = String::new();
    several.stderr.take().expect("piped").read_to_string(&mut printed).expect("text");
    several.wait().expect("it ends");
    assert!(printed.contains("no data from the daemon for 40 s"), "{printed}");
    patient.kill().expect("it runs");
    patient.wait().expect("it ends");
    assert_eq!(daemon.stop(), Some(0));
}
