//! Listening addresses: sockets that are removed or replaced, addresses that come later, and starts that are rejected.

use std::{
    fs,
    net::{TcpListener, TcpStream},
    os::unix::{fs::MetadataExt as _, net::UnixListener},
    path::Path,
    time::Duration,
};

use serde_json::{Value, json};

use rustix::process::Signal;

use super::{Daemon, send_request, write_token};
use crate::common::{run, stderr, wait_until};

fn health_by_tcp(address: &str) -> Value {
    let stream = TcpStream::connect(address).expect("it listens there");
    send_request(stream, "GET", "/v1/health", &[("Host", "localhost")], "").json()
}

fn is_unwell(health: &Value, words: &str) -> bool {
    let reasons = health["reasons"].as_array().expect("a list");
    reasons.iter().any(|reason| reason.as_str().is_some_and(|text| text.contains(words)))
}

/// Returns how often the daemon has logged a text.
fn count(daemon: &Daemon, words: &str) -> usize {
    daemon.messages().matches(words).count()
}

#[test]
fn removed_socket_is_bound_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let socket = folder.path().join("s");
    let daemon = Daemon::start_mock(folder.path(), &["--set", "server.socket_mode=0620"]);
    for round in 1..=2 {
        fs::remove_file(&socket).expect("it is there");
        wait_until("the socket", || daemon.connect().is_ok());
        assert_eq!(fs::metadata(&socket).expect("it is there").mode() & 0o777, 0o620);
        wait_until("the report", || count(&daemon, "removed; bound again") == round);
    }
    assert_eq!(daemon.status()["server"]["listening"], json!([socket]));
    assert_eq!(daemon.stop(), Some(0));
    assert!(!socket.exists());
}

#[test]
fn foreign_socket_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let socket = folder.path().join("s");
    let daemon = Daemon::start_mock(folder.path(), &["--set", "server.listen=127.0.0.1:0"]);
    let address = daemon.address();
    fs::remove_file(&socket).expect("it is there");
    let theirs = UnixListener::bind(&socket).expect("a free path");
    let id = fs::metadata(&socket).expect("it is there").ino();
    wait_until("the reason", || is_unwell(&health_by_tcp(&address), "another process"));
    // A stale socket without a listener still does not belong to this daemon.
    drop(theirs);
    std::thread::sleep(Duration::from_secs(5));
    assert_eq!(count(&daemon, "another process"), 1, "{}", daemon.messages());
    assert_eq!(fs::metadata(&socket).expect("it is there").ino(), id);
    fs::remove_file(&socket).expect("it is there");
    wait_until("the socket", || daemon.connect().is_ok());
    wait_until("health", || daemon.health()["healthy"] == true);
    fs::rename(&socket, folder.path().join("aside")).expect("it is there");
    let theirs = UnixListener::bind(&socket).expect("a free path");
    assert_eq!(daemon.stop(), Some(0));
    assert!(socket.exists());
    drop(theirs);
}

#[test]
fn busy_tcp_port() {
    let folder = tempfile::tempdir().expect("a folder");
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = taken.local_addr().expect("an address").to_string();
    let listen = format!("server.listen={address}");
    let plan = ["--set", "scanning.mode=continuous", "--set", "plan.to_deg=18"];
    let daemon = Daemon::start_mock(folder.path(), &[&["--set", &listen][..], &plan].concat());
    daemon.wait_for_scans(1);
    assert!(is_unwell(&daemon.health(), &format!("server.listen {address}")));
    std::thread::sleep(Duration::from_secs(5));
    assert_eq!(count(&daemon, "cannot be bound yet"), 1, "{}", daemon.messages());
    drop(taken);
    wait_until("the address", || TcpStream::connect(&address).is_ok());
    wait_until("health", || health_by_tcp(&address)["healthy"] == true);
    wait_until("the message", || count(&daemon, "listening on http://") > 0);
    assert_eq!(count(&daemon, "listening on http://"), 1, "{}", daemon.messages());
    assert_eq!(daemon.stop(), Some(0));
}

/// A text without the spaces and marks at which a terminal's width breaks lines.
fn dense(text: &str) -> String {
    text.chars().filter(|letter| !letter.is_whitespace() && *letter != '│').collect()
}

/// Options of a start in `folder`, as a mock.
fn options(folder: &Path, further: &[&str]) -> Vec<String> {
    let path = |name: &str| folder.join(name).display().to_string();
    let mut options: Vec<String> =
        ["run", "--mock", "--scene", "simple-room", "--pose", "fig9"].map(Into::into).into();
    options.extend(["--log".into(), path("log"), "--socket".into(), path("s")]);
    options.extend(further.iter().map(ToString::to_string));
    options
}

#[test]
fn impossible_addresses() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    fs::write(path("open"), "0123456789abcdef").expect("there is room");
    fs::write(path("fleet.toml"), "[[daemon]]\naddress = \"h:1\"\ntoken_file = \"open\"\n")
        .expect("there is room");
    let empty = write_token(folder.path(), "").display().to_string();
    let before = fs::read_dir(folder.path()).expect("a folder").count();
    for (setting, words) in [
        ("server.listen=0.0.0.0:0".into(), "other computers"),
        ("server.listen=[::]:0".into(), "other computers"),
        ("server.listen=224.0.0.1:8765".into(), "multicast"),
        ("server.listen=255.255.255.255:8765".into(), "broadcast"),
        ("server.listen=[fe80::1]:8765".into(), "interface"),
        ("server.listen=localhost".into(), "127.0.0.1:8765"),
        (format!("server.token_file={}", path("open")), "chmod 600"),
        (format!("server.token_file={}", path("missing")), "No such file"),
        (format!("server.token_file={empty}"), "shorter"),
        (format!("server.token_file={}", folder.path().display()), "not a regular file"),
        (format!("server.playground={}", path("missing")), "index.html"),
        (format!("fleet.file={}", path("missing")), "No such file"),
        (format!("fleet.file={}", path("fleet.toml")), "chmod 600"),
    ] {
        for check in [&["--check"][..], &[]] {
            let options = options(folder.path(), &[&["--set", &setting], check].concat());
            let options: Vec<&str> = options.iter().map(String::as_str).collect();
            let output = run(&options);
            let printed = stderr(&output);
            assert_eq!(output.status.code(), Some(2), "{setting} {check:?}: {printed}");
            assert!(dense(&printed).contains(&dense(words)), "{setting} {check:?}: {printed}");
        }
        let after = fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(after, before, "{setting}: nothing is left");
    }
}

#[test]
fn failed_start_leaves_no_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    fs::write(path("file"), "").expect("there is room");
    let [file, below, far] = ["file", "file/below", "missing/s"].map(path);
    let mock = ["run", "--mock", "--scene", "simple-room", "--pose", "fig9", "--log"];
    // A folder that is missing may be made before the next start.
    for (log, socket, start, check) in [
        (&file, &path("s"), 2, 2),
        (&below, &path("s"), 2, 2),
        (&path("log"), &file, 3, 3),
        (&path("log"), &below, 3, 3),
        (&path("log"), &far, 3, 0),
    ] {
        let options = [&mock[..], &[log, "--socket", socket]].concat();
        let output = run(&options);
        assert_eq!(output.status.code(), Some(start), "{log} {socket}: {}", stderr(&output));
        let output = run(&[&options[..], &["--check"]].concat());
        assert_eq!(output.status.code(), Some(check), "{log} {socket}: {}", stderr(&output));
        let left: Vec<_> = fs::read_dir(folder.path())
            .expect("a folder")
            .map(|entry| entry.expect("an entry").file_name())
            .collect();
        assert_eq!(left, ["file"], "{log} {socket}");
    }
}

#[test]
fn changed_files_on_reload() {
    let folder = tempfile::tempdir().expect("a folder");
    let token = write_token(folder.path(), "0123456789abcdef");
    let key = format!("server.token_file={}", token.display());
    let daemon = Daemon::start_mock(folder.path(), &["--set", &key]);
    let configuration = || daemon.status()["configuration"].clone();
    let waits = |what: &[&str]| {
        daemon.signal(Signal::HUP);
        wait_until("a report", || configuration()["needs_restart"] == json!(what));
    };
    fs::write(&token, "another-token-0123").expect("there is room");
    waits(&["contents of server.token_file"]);
    wait_until("a message", || count(&daemon, "after a restart: contents of server.token") == 1);
    // Nothing has changed since the last reload, yet since the start.
    daemon.signal(Signal::HUP);
    wait_until("a message", || count(&daemon, "after a restart: contents of server.token") == 2);
    assert_eq!(configuration()["needs_restart"], json!(["contents of server.token_file"]));

    fs::write(&token, "short").expect("there is room");
    daemon.signal(Signal::HUP);
    wait_until("a refusal", || {
        configuration()["error"].as_str().is_some_and(|error| error.contains("shorter"))
    });
    fs::write(&token, "0123456789abcdef").expect("there is room");
    waits(&[]);
    assert_eq!(configuration()["error"], Value::Null);
    assert_eq!(daemon.stop(), Some(0));
}
