//! Strangers, floods and clients that dawdle: refused, while the scan goes on.

use std::{
    io::{Read as _, Write as _},
    time::{Duration, Instant},
};

use super::{Daemon, ask, read_reply};
use crate::common::wait_until;

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

fn start(folder: &std::path::Path, further: &[&str]) -> Daemon {
    let token = folder.join("token");
    std::fs::write(&token, format!("{TOKEN}\n")).expect("a file");
    let token = format!("server.token_file={}", token.display());
    let tcp = [
        "--set",
        "server.listen=127.0.0.1:0",
        "--set",
        &token,
        "--set",
        "scanning.mode=continuous",
    ];
    let daemon = Daemon::start_mock(folder, &[&tcp, further].concat());
    wait_until("the address", || daemon.said().contains("http://"));
    daemon
}

fn beams(daemon: &Daemon) -> u64 {
    daemon.status()["scan"]["done"].as_u64().unwrap_or(0)
}

#[test]
fn strangers_are_refused_and_the_daemon_keeps_scanning() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &[]);
    wait_until("some beams", || beams(&daemon) > 2);
    let before = beams(&daemon);
    let host = ("Host", "localhost");
    let json = ("Content-Type", "application/json");
    let bearer = format!("Bearer {TOKEN}");
    let token = ("Authorization", bearer.as_str());
    let large = format!(r#"{{"scans": {}1}}"#, " ".repeat(200_000));
    for (method, path, headers, body, status) in [
        ("GET", "/v1/status", vec![host], "", 200),
        ("GET", "/v1/status", vec![("Host", "evil.example")], "", 403),
        ("GET", "/v1/status", vec![], "", 403),
        ("GET", "http://evil.example/v1/status", vec![host], "", 403),
        ("GET", "/v1/live/records", vec![host, ("Origin", "http://evil.example")], "", 403),
        ("POST", "/v1/stop", vec![host], "", 401),
        ("POST", "/v1/stop", vec![host, ("Authorization", "Bearer wrong")], "", 401),
        ("POST", "/v1/stop", vec![host, token, ("Origin", "https://evil.example")], "", 403),
        ("POST", "/v1/start", vec![host, token, json], large.as_str(), 413),
        ("POST", "/v1/start", vec![host, token, json], "{{{{", 400),
        ("POST", "/v1/start", vec![host, token, ("Content-Type", "text/plain")], "{}", 415),
        ("POST", "/v1/start", vec![host, token, json], "{}", 202),
    ] {
        let reply = ask(daemon.connect_tcp(), method, path, &headers, body);
        assert_eq!(reply.status, status, "{method} {path} {headers:?}: {}", reply.json());
    }
    // Not HTTP at all, and heads without end.
    let mut stream = daemon.connect_tcp();
    stream.write_all(b"\x16\x03\x01\x02\x00garbage\r\n\r\n").expect("it listens");
    assert_eq!(read_reply(stream).status, 400);
    let mut stream = daemon.connect_tcp();
    let flood = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n", "a".repeat(300_000));
    // It may hang up while being flooded.
    drop(stream.write_all(flood.as_bytes()));
    let mut answer = Vec::new();
    drop(stream.read_to_end(&mut answer));
    assert!(!String::from_utf8_lossy(&answer).contains(" 200 "));
    wait_until("more beams", || beams(&daemon) > before + 5);
    assert_eq!(daemon.health()["scans"]["stopped"], 0);
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn clients_that_dawdle_lose_their_places_and_too_many_are_turned_away() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &["--set", "server.max_clients=8"]);
    let began = Instant::now();
    // Seven heads that never end, and one place for everybody else.
    let mut slow: Vec<_> = (0..7).map(|_| daemon.connect_tcp()).collect();
    for stream in &mut slow {
        stream.write_all(b"GET /v1/status HTTP/1.1\r\nHost: local").expect("it listens");
    }
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(daemon.get("/v1/status").status, 200);
    let mut one_more = daemon.connect_tcp();
    one_more.write_all(b"GET /v1/status HTTP/1.1\r\nHost: local").expect("it listens");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(daemon.get("/v1/status").status, 503, "all places are taken");
    for mut stream in slow {
        let mut answer = Vec::new();
        // Closed by the daemon, with or without a word.
        drop(stream.read_to_end(&mut answer));
    }
    assert!(began.elapsed() < Duration::from_secs(12), "{:?}", began.elapsed());
    // A body that never ends.
    let mut stream = daemon.connect().expect("a place is free again");
    let head = "POST /v1/start HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n\
                Content-Length: 10\r\n\r\n{";
    stream.write_all(head.as_bytes()).expect("it listens");
    assert_eq!(read_reply(stream).status, 408);
    assert!(beams(&daemon) > 5, "it went on scanning");
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn a_flood_of_requests_is_cut_to_the_rate() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &["--set", "server.max_requests_per_s=20"]);
    let statuses: Vec<u16> = (0..100).map(|_| daemon.get("/v1/plan").status).collect();
    let passed = statuses.iter().filter(|&&status| status == 200).count();
    let refused = statuses.iter().filter(|&&status| status == 429).count();
    assert!(
        passed >= 20 && refused >= 20 && passed + refused == 100,
        "{passed} passed, {refused} refused"
    );
    std::thread::sleep(Duration::from_secs(1));
    assert!(beams(&daemon) > 0);
}
