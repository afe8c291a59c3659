//! Notifications to systemd, and the socket that systemd passes.

use std::{
    os::unix::net::UnixDatagram,
    path::Path,
    process::Command,
    time::{Duration, Instant},
};

use sonard::mock::Pace;

use super::{Daemon, rig::Rig, send_request};
use crate::common::{sonard, wait_until};

/// Returns the notifications to `socket` up to the one that contains `wanted`.
fn receive(socket: &UnixDatagram, wanted: &str) -> String {
    let mut printed = String::new();
    let mut datagram = [0; 4096];
    let until = Instant::now() + Duration::from_secs(20);
    while !printed.contains(wanted) {
        assert!(Instant::now() < until, "no {wanted} in {printed}");
        let count =
            socket.recv(&mut datagram).unwrap_or_else(|_| panic!("no {wanted} in {printed}"));
        printed += &String::from_utf8_lossy(&datagram[..count]);
        printed.push('\n');
    }
    printed
}

#[test]
fn ready_and_watchdog() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    let path = folder.path().join("notify");
    let socket = UnixDatagram::bind(&path).expect("a socket");
    socket.set_read_timeout(Some(Duration::from_secs(20))).expect("a socket");
    let mut command = sonard(&[]);
    command.env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", "3300000").env_remove("WATCHDOG_PID");
    let options = rig.options();
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let continuous = ["--set", "scanning.mode=continuous"];
    let daemon = Daemon::start_as(command, folder.path(), &[&options[..], &continuous].concat());
    let mut waiting = receive(&socket, "EXTEND_TIMEOUT_USEC");
    for _ in 0..4 {
        waiting += &receive(&socket, "WATCHDOG=1");
    }
    assert!(waiting.contains("STATUS=absent: ") && !waiting.contains("READY=1"), "{waiting}");
    rig.plug("", 1);
    receive(&socket, "READY=1");
    receive(&socket, "STATUS=scanning");
    for _ in 0..3 {
        receive(&socket, "WATCHDOG=1");
    }
    let reader = std::thread::spawn(move || receive(&socket, "STOPPING=1"));
    assert_eq!(daemon.stop(), Some(0));
    reader.join().expect("a notification of the end");
}

#[test]
fn socket_activation() {
    if Command::new("systemd-socket-activate").arg("--version").output().is_err() {
        println!("systemd-socket-activate is not here: left out");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let handed = folder.path().join("handed");
    let mut child = Command::new("systemd-socket-activate")
        .arg("-l")
        .arg(&handed)
        .arg(env!("CARGO_BIN_EXE_sonard"))
        .args(["run", "--mock", "--scene", "simple-room", "--pose", "fig9", "--log"])
        .arg(folder.path().join("log"))
        .arg("--socket")
        .arg(folder.path().join("configured"))
        .stderr(std::process::Stdio::null())
        .spawn()
        .expect("starts");
    wait_until("the socket", || handed.exists());
    assert_eq!(status(&handed), 200);
    assert!(!folder.path().join("configured").exists(), "the socket handed over is enough");
    crate::common::interrupt(child.id());
    child.wait().expect("it ends");
    assert!(handed.exists(), "it belongs to systemd");
}

fn status(socket: &Path) -> u16 {
    let stream = std::os::unix::net::UnixStream::connect(socket).expect("it listens");
    send_request(stream, "GET", "/v1/status", &[("Host", "localhost")], "").status
}
