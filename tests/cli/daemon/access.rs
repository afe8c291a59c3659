//! Foreign origins, floods and slow clients are rejected while the scan continues.

use std::{
    io::{Read as _, Write as _},
    net::TcpStream,
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant},
};

use sonard::server::Peer;
use sonard_test_support::in_process::Daemon;

use super::{self as processes, Reply, read_reply, send_request, write_token};
use crate::common::{SetOnDrop, wait_until};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

fn options(folder: &std::path::Path, further: &[&str]) -> Vec<String> {
    let token = write_token(folder, format!("{TOKEN}\n"));
    let token = format!("server.token_file={}", token.display());
    let tcp = ["server.listen=127.0.0.1:0", &token, "scanning.mode=continuous"];
    let settings = tcp.iter().chain(further);
    settings.flat_map(|setting| ["--set".to_owned(), (*setting).to_owned()]).collect()
}

fn start(folder: &std::path::Path, further: &[&str]) -> Daemon {
    let options = options(folder, further);
    Daemon::start_mock(folder, &options.iter().map(String::as_str).collect::<Vec<_>>())
}

fn beams(daemon: &Daemon) -> u64 {
    daemon.status()["scan"]["done"].as_u64().unwrap_or(0)
}

#[test]
fn foreign_origins_are_rejected() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &[]);
    daemon.wait_until("some beams", || beams(&daemon) > 2);
    let before = beams(&daemon);
    let host = ("Host", "localhost");
    let json = ("Content-Type", "application/json");
    let bearer = format!("Bearer {TOKEN}");
    let token = ("Authorization", bearer.as_str());
    let lower = format!("bearer {TOKEN}");
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
        ("POST", "/v1/start", vec![host, ("authorization", lower.as_str()), json], "{}", 202),
        ("GET", "/v1/logs/%ff", vec![host], "", 400),
        ("GET", "/page/%ff", vec![host], "", 400),
        ("GET", "/v1/status", vec![host, ("Sec-Fetch-Site", "cross-site")], "", 403),
    ] {
        let reply = send_request(daemon.connect_as(Peer::Loopback), method, path, &headers, body);
        assert_eq!(reply.status, status, "{method} {path} {headers:?}: {}", reply.json());
        if status >= 400 {
            assert_problem(&reply, path);
        }
        let asks_for_token = reply.head.contains("www-authenticate: bearer");
        assert_eq!(asks_for_token, status == 401, "{}", reply.head);
        assert!(reply.head.contains("cross-origin-resource-policy: same-origin"), "{}", reply.head);
    }
    // Not HTTP at all, and heads without end.
    let mut stream = daemon.connect_as(Peer::Loopback);
    stream.write_all(b"\x16\x03\x01\x02\x00garbage\r\n\r\n").expect("it listens");
    let garbage = read_reply(stream);
    assert_eq!(garbage.status, 400);
    assert_problem(&garbage, "no HTTP");
    let mut stream = daemon.connect_as(Peer::Loopback);
    let many: String = (0..200).map(|n| format!("X-{n}: 1\r\n")).collect();
    let head = format!("GET / HTTP/1.1\r\nHost: localhost\r\n{many}\r\n");
    stream.write_all(head.as_bytes()).expect("it listens");
    let crowded = read_reply(stream);
    assert_eq!(crowded.status, 431);
    assert_problem(&crowded, "a head of many fields");
    let mut stream = daemon.connect_as(Peer::Loopback);
    let flood = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n", "a".repeat(300_000));
    // It may hang up while being flooded.
    drop(stream.write_all(flood.as_bytes()));
    let mut answer = Vec::new();
    drop(stream.read_to_end(&mut answer));
    assert!(!String::from_utf8_lossy(&answer).contains(" 200 "));
    daemon.wait_until("more beams", || beams(&daemon) > before + 5);
    assert_eq!(daemon.health()["scans"]["stopped"], 0);
    daemon.stop();
}

#[test]
fn slow_and_excess_clients() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &["server.max_clients=8"]);
    // Seven heads that never end, and one place for everybody else who comes by TCP.
    let mut slow: Vec<_> = (0..7).map(|_| daemon.connect_as(Peer::Loopback)).collect();
    for stream in &mut slow {
        stream.write_all(b"GET /v1/status HTTP/1.1\r\nHost: local").expect("it listens");
    }
    daemon.pass(Duration::from_millis(300));
    let by_tcp = || {
        send_request(
            daemon.connect_as(Peer::Loopback),
            "GET",
            "/v1/status",
            &[("Host", "localhost")],
            "",
        )
    };
    assert_eq!(by_tcp().status, 200);
    let mut one_more = daemon.connect_as(Peer::Loopback);
    one_more.write_all(b"GET /v1/status HTTP/1.1\r\nHost: local").expect("it listens");
    daemon.pass(Duration::from_millis(300));
    let full = by_tcp();
    assert_eq!(full.status, 503, "all places are taken");
    assert_problem(&full, "a full house");
    assert_eq!(daemon.get("/v1/status").status, 200, "those of the socket are not");
    for mut stream in slow {
        let mut answer = Vec::new();
        // Closed by the daemon, with or without a word.
        drop(stream.read_to_end(&mut answer));
    }
    // A body that never ends.
    let mut stream = daemon.connect();
    let head = "POST /v1/start HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n\
                Content-Length: 10\r\n\r\n{";
    stream.write_all(head.as_bytes()).expect("it listens");
    let late = read_reply(stream);
    assert_eq!(late.status, 408);
    assert_problem(&late, "a body that never ends");
    assert!(beams(&daemon) > 5, "it went on scanning");
    daemon.stop();
}

#[test]
fn request_rate_limit() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &["server.max_requests_per_s=20"]);
    let statuses: Vec<u16> = (0..100).map(|_| daemon.get("/v1/plan").status).collect();
    let passed = statuses.iter().filter(|&&status| status == 200).count();
    let refused = statuses.iter().filter(|&&status| status == 429).count();
    assert!(
        passed >= 20 && refused >= 20 && passed + refused == 100,
        "{passed} passed, {refused} refused"
    );
    daemon.pass(Duration::from_secs(1));
    daemon.wait_until("beams", || beams(&daemon) > 0);
}

/// Checks the format of a rejection.
fn assert_problem(reply: &Reply, of: &str) {
    assert!(reply.head.contains("content-type: application/json"), "{of}: {}", reply.head);
    let problem = reply.json();
    let has_text = |name: &str| problem[name].as_str().is_some_and(|text| !text.is_empty());
    assert!(has_text("error") && has_text("help"), "{of}: {problem}");
}

#[test]
fn loopback_without_token() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = options(folder.path(), &["server.max_requests_per_s=50"]);
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let daemon = processes::Daemon::start_mock(folder.path(), &options);
    wait_until("the address", || daemon.messages().contains("http://"));
    let subscribe = |host: &str| {
        let mut stream = daemon.connect_tcp();
        let request = format!("GET /v1/live/records HTTP/1.1\r\nHost: {host}\r\n\r\n");
        drop(stream.write_all(request.as_bytes()));
        stream
    };
    // As many streams as there are places, and a flood of what is refused and of what is not.
    let streams: Vec<_> = (0..128)
        .map(|_| {
            // Within the rate.
            thread::sleep(Duration::from_millis(25));
            subscribe("localhost")
        })
        .collect();
    let streaming = || daemon.status()["subscribers"]["now"].as_u64();
    wait_until("the strangers' streams", || streaming() >= Some(64));
    let over = AtomicBool::new(false);
    let refused = thread::scope(|scope| {
        let end = SetOnDrop(&over);
        let flood = |host: &'static str| {
            let (daemon, over) = (&daemon, &over);
            scope.spawn(move || {
                let mut answers = 0;
                while !over.load(Ordering::Relaxed) {
                    let Ok(mut stream) = TcpStream::connect(daemon.address()) else { continue };
                    drop(stream.set_read_timeout(Some(Duration::from_secs(1))));
                    let request = format!("GET /v1/status HTTP/1.1\r\nHost: {host}\r\n\r\n");
                    drop(stream.write_all(request.as_bytes()));
                    answers += usize::from(stream.read(&mut [0; 64]).is_ok_and(|got| got > 0));
                }
                answers
            })
        };
        let floods = [flood("evil.example"), flood("evil.example"), flood("localhost")];
        // What the owner is allowed, nearly: forty requests a second.
        for _ in 0..120 {
            let began = Instant::now();
            let reply = daemon.get("/v1/status");
            assert_eq!(reply.status, 200, "{}", String::from_utf8_lossy(&reply.body));
            thread::sleep(Duration::from_millis(25).saturating_sub(began.elapsed()));
        }
        assert_eq!(daemon.send("POST", "/v1/stop", "").status, 202);
        assert_eq!(daemon.send("POST", "/v1/start", "{}").status, 202);
        drop(end);
        floods.into_iter().map(|one| one.join().expect("no panic")).sum::<usize>()
    });
    assert!(refused > 0, "the strangers are answered, too");
    assert_eq!(streaming(), Some(64), "guests get half of the places for streams");
    drop(streams);
    assert_eq!(daemon.stop(), Some(0));
}
