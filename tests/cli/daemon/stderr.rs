//! Standard error that is closed, full or gone.

use std::{
    fs,
    io::{PipeReader, Read as _},
    os::fd::AsFd as _,
    path::Path,
    process::{Child, Stdio},
};

use sonard::mock::Pace;

use super::{Daemon, clean_log, rig::Rig};
use crate::common::{sonard, wait_until};

/// A daemon on a rig whose standard error is a pipe with `reader` at its other end.
fn start(rig: &Rig, folder: &Path) -> (Daemon, PipeReader) {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    let child: Child = sonard(&["run", "--log"])
        .arg(folder.join("log"))
        .arg("--socket")
        .arg(folder.join("s"))
        .args(rig.options())
        .args(["--set", "scanning.mode=continuous", "--set", "plan.step_deg=9"])
        .env("SONARD_LOG", "debug")
        .stderr(Stdio::from(writer))
        .spawn()
        .expect("the program starts");
    (Daemon::from_child(child, folder), reader)
}

/// Unplugs and plugs the ranger, which the daemon reports each time, and waits until it measures again.
fn replug(daemon: &Daemon, rig: &mut Rig, seed: u64) {
    rig.unplug();
    daemon.wait_for("absent");
    rig.plug("", seed);
    let before = daemon.health()["scans"]["completed"].as_u64().unwrap_or(0);
    wait_until("another scan", || daemon.health()["scans"]["completed"].as_u64() > Some(before));
}

#[test]
fn closed_stderr() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::Virtual);
    rig.plug("", 1);
    let (daemon, reader) = start(&rig, folder.path());
    drop(reader);
    for seed in 2..4 {
        replug(&daemon, &mut rig, seed);
    }
    assert_eq!(daemon.stop(), Some(0));
    clean_log(folder.path());
}

#[test]
fn full_stderr() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::Virtual);
    rig.plug("", 1);
    let (daemon, mut reader) = start(&rig, folder.path());
    let pipe = fs::OpenOptions::new()
        .write(true)
        .open(format!("/proc/{}/fd/2", daemon.id()))
        .expect("its standard error");
    rustix::io::ioctl_fionbio(pipe.as_fd(), true).expect("a pipe");
    let mut fill = &pipe;
    while std::io::Write::write(&mut fill, &[b'x'; 4096]).is_ok() {}
    rustix::io::ioctl_fionbio(pipe.as_fd(), false).expect("a pipe");
    drop(pipe);
    for seed in 2..6 {
        replug(&daemon, &mut rig, seed);
    }
    let metrics = String::from_utf8(daemon.get("/metrics").body).expect("text");
    assert!(metrics.contains("sonard_dropped_messages_total"), "{metrics}");
    let stopping = std::thread::spawn(move || daemon.stop());
    wait_until("the end", || stopping.is_finished());
    assert_eq!(stopping.join().expect("no panic"), Some(0));
    clean_log(folder.path());
    // What fits the pipe is there, and nothing waits for the rest.
    let mut text = Vec::new();
    reader.read_to_end(&mut text).expect("closed");
    assert!(text.len() > 4096);
}
