//! Access of viewers by the rules of the API; invalid messages are rejected.

use std::{
    io::{Read, Write},
    time::Duration,
};

use serde_json::{Value, json};
use sonard::server::Peer;
use sonard_test_support::in_process::Daemon;
use tungstenite::{
    Message,
    protocol::frame::{
        Frame,
        coding::{Data, OpCode},
    },
};

use super::{
    super::{send_request, write_token},
    start, start_process,
    viewer::{Came, Viewer, request_viewer},
};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";
const PROTOCOL: (&str, &str) = ("sec-websocket-protocol", "foxglove.sdk.v1");

#[test]
fn access_rules_of_the_api() {
    let folder = tempfile::tempdir().expect("a folder");
    let token = format!("server.token_file={}", write_token(folder.path(), TOKEN).display());
    let daemon = Daemon::start_at_level(
        "trace",
        folder.path(),
        &[
            "--mock",
            "--scene",
            "simple-room",
            "--pose",
            "fig9",
            "--set",
            "server.listen=127.0.0.1:0",
            "--set",
            &token,
            "--set",
            "foxglove.enabled=true",
        ],
    );
    let with_token = format!("/foxglove/?token={TOKEN}");
    let bearer = format!("Bearer {TOKEN}");
    for (path, headers, status) in [
        ("/foxglove/", vec![PROTOCOL], 101),
        ("/foxglove/", vec![PROTOCOL, ("origin", "http://localhost:8080")], 101),
        ("/foxglove/", vec![PROTOCOL, ("origin", "https://app.foxglove.dev")], 101),
        ("/foxglove/", vec![("sec-websocket-protocol", "a, foxglove.websocket.v1")], 101),
        (&with_token, vec![PROTOCOL], 101),
        ("/foxglove/", vec![PROTOCOL, ("authorization", &bearer)], 101),
        ("/foxglove/", vec![PROTOCOL, ("origin", "https://evil.example")], 403),
        (&with_token, vec![PROTOCOL, ("origin", "https://evil.example")], 403),
        ("/foxglove/", vec![PROTOCOL, ("origin", "null")], 403),
        ("/foxglove/", vec![PROTOCOL, ("origin", "file://")], 403),
        ("/foxglove/", vec![PROTOCOL, ("host", "evil.example")], 403),
        ("/foxglove/", vec![], 400),
        ("/foxglove/", vec![("sec-websocket-protocol", "mqtt")], 400),
        ("/foxglove/", vec![PROTOCOL, ("sec-websocket-version", "8")], 400),
        ("/v1/live/records", vec![PROTOCOL, ("origin", "https://app.foxglove.dev")], 403),
    ] {
        let requested = request_viewer(daemon.connect_as(Peer::Loopback), path, &headers);
        let answered = requested.as_ref().map_or_else(|rejected| *rejected, |_| 101);
        assert_eq!(answered, status, "{path} {headers:?}");
    }
    // No WebSocket at all.
    let plain = send_request(
        daemon.connect_as(Peer::Loopback),
        "GET",
        "/foxglove/",
        &[("Host", "localhost")],
        "",
    );
    assert_eq!(plain.status, 400);
    assert!(plain.json()["help"].as_str().is_some_and(|help| help.contains("ws://")));
    daemon.wait_until("they left", || daemon.status()["subscribers"]["now"] == 0);
    let printed = daemon.messages();
    assert!(!printed.contains(TOKEN), "{printed}");
    assert_eq!(printed.matches("add the origin to foxglove.origins").count(), 1, "{printed}");
    daemon.stop();
}

#[test]
fn key_and_viewer_limit() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &[]);
    let requested = request_viewer(daemon.connect(), "/foxglove/", &[PROTOCOL]);
    assert_eq!(requested.err(), Some(404));
    daemon.stop();

    let second = tempfile::tempdir().expect("a folder");
    let by_tcp = ["--set", "foxglove.max_clients=3", "--set", "server.listen=127.0.0.1:0"];
    let daemon = start(second.path(), &by_tcp);
    let connect = || daemon.connect();
    let mut viewers: Vec<_> = (0..3).map(|_| Viewer::new(connect(), "foxglove.sdk.v1")).collect();
    assert_eq!(request_viewer(connect(), "/foxglove/", &[PROTOCOL]).err(), Some(503));
    // Guests have places of their own.
    let guests = || request_viewer(daemon.connect_as(Peer::Loopback), "/foxglove/", &[PROTOCOL]);
    let came: Vec<_> = (0..4).map(|_| guests()).collect();
    assert_eq!(came.iter().filter(|one| one.is_ok()).count(), 3);
    drop(viewers.pop());
    daemon.wait_until("a place", || request_viewer(connect(), "/foxglove/", &[PROTOCOL]).is_ok());
    // Present viewers receive a close frame.
    let mut last = viewers.pop().expect("a viewer");
    drop((last.text(), last.text()));
    daemon.stop();
    assert!(matches!(last.next(), Some(Came::End(1001))));
}

/// A place is one also while a viewer holds it, long after the request for it was answered.
#[test]
fn connection_slots() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &["--set", "server.max_clients=4"]);
    let connect = || daemon.connect();
    let viewers: Vec<_> = (0..4).map(|_| Viewer::new(connect(), "foxglove.sdk.v1")).collect();
    let full = || send_request(connect(), "GET", "/v1/status", &[("Host", "localhost")], "").status;
    assert_eq!(full(), 503);
    drop(viewers);
    daemon.wait_until("places", || full() == 200);
    daemon.stop();
}

/// The words of the next status that refuses something.
fn refusal(viewer: &mut Viewer<impl Read + Write>) -> String {
    loop {
        let text = viewer.text();
        if text["op"] == "status" && text["level"] == 2 {
            return text["message"].as_str().expect("words").to_owned();
        }
    }
}

#[test]
fn invalid_messages() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start_process(folder.path(), &["--virtual-time"]);
    daemon.wait_for("ready");
    let scan = || {
        let done = daemon.health()["scans"]["completed"].as_u64().expect("a count");
        assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
        daemon.wait_for_scans(done + 1);
    };
    scan();
    let connect = || Viewer::new(daemon.connect().expect("it listens"), "foxglove.sdk.v1");
    let mut viewer = connect();
    viewer.wait_for_channels();
    let (range, _) = viewer.channels["/sonar/range"].clone();
    let wish = |id: u64, channel: u64| json!({"id": id, "channelId": channel});
    let subscribe = |wishes: Vec<Value>| json!({"op": "subscribe", "subscriptions": wishes});
    let many: Vec<Value> = (0..1500).map(|id| wish(id, id + 1000)).collect();
    for (order, words) in [
        (subscribe(vec![wish(1, 999)]), "unknown channel 999"),
        (subscribe(vec![wish(1, range), wish(2, range)]), "already subscribed to"),
        (subscribe(many), "and 1499 more"),
        (json!({"op": "unsubscribe", "subscriptionIds": [77]}), "unknown subscription 77"),
        (json!({"op": "advertise", "channels": []}), "only publishes"),
        (json!("?"), "invalid message"),
    ] {
        viewer.send(&order);
        let message = refusal(&mut viewer);
        assert!(message.contains(words), "{order:.80}: {message}");
    }
    viewer.socket.send(Message::binary(vec![1, 2, 3])).expect("it takes that");
    assert!(refusal(&mut viewer).contains("only publishes"));
    // Still subscribed and served.
    scan();
    while !matches!(viewer.next(), Some(Came::Message(1, _))) {}

    // 10,000 subscriptions at once, and endless fragments: too much for one text.
    let all: Vec<Value> = (0..10_000).map(|id| wish(id, id)).collect();
    let mut large = connect();
    large.send(&subscribe(all));
    let message = refusal(&mut large);
    assert!(message.contains("at most 65536 bytes"), "{message}");
    let mut fragments = connect();
    let piece = |code: Data, last: bool| {
        Message::Frame(Frame::message(vec![b' '; 1000], OpCode::Data(code), last))
    };
    drop(fragments.socket.send(piece(Data::Text, false)));
    for _ in 0..2000 {
        if fragments.socket.send(piece(Data::Continue, false)).is_err() {
            break;
        }
    }
    assert!(matches!(shown_out(&mut fragments), Some(1008) | None));
    // A frame whose stated length exceeds memory, and bytes that are no frame.
    for bytes in
        [&b"\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0"[..], b"\xff\xff\xff\xff\xff\xff"]
    {
        let mut raw = connect();
        raw.socket.get_mut().write_all(bytes).expect("it listens");
        assert!(matches!(shown_out(&mut raw), Some(1002 | 1008) | None));
    }
    let mut stubborn = connect();
    for _ in 0..100 {
        if stubborn.socket.send(Message::text("?")).is_err() {
            break;
        }
    }
    assert_eq!(shown_out(&mut stubborn), Some(1008));
    assert_eq!(daemon.health()["scans"]["stopped"], 0);
    scan();
    while !matches!(viewer.next(), Some(Came::Message(1, _))) {}
    assert_eq!(daemon.stop(), Some(0));
}

/// The code with which the server closes; `None` if the connection breaks.
fn shown_out(viewer: &mut Viewer<std::os::unix::net::UnixStream>) -> Option<u16> {
    viewer.socket.get_ref().set_read_timeout(Some(Duration::from_secs(20))).expect("a socket");
    loop {
        match viewer.next() {
            Some(Came::End(code)) => return Some(code),
            Some(_) => {}
            None => return None,
        }
    }
}
