//! Stop requests, however they arrive.

use std::{
    fs,
    os::{fd::OwnedFd, unix::process::CommandExt as _},
    path::Path,
    process::Stdio,
    time::Duration,
};

use rustix::process::{Pid, Signal, kill_process};
use sonard::{link::Pty, mock::Pace};

use super::{Daemon, clean_log, rig::Rig};
use crate::common::{Log, MockProcess, sonard, wait_until, without_terminal};

const FAST: [&str; 6] = [
    "--set",
    "scanning.mode=continuous",
    "--set",
    "model.max_range_m=3",
    "--set",
    "plan.step_deg=9",
];

fn scanning(folder: &Path) -> Daemon {
    let daemon = Daemon::start_mock(folder, &FAST);
    wait_until("beams", || daemon.status()["scan"]["done"].as_u64() >= Some(2));
    daemon
}

/// Fails unless every scan that has begun has an end, and the socket is gone.
fn assert_closed(folder: &Path) {
    let log = clean_log(folder);
    let count = |kind| log.of_type(kind).count();
    assert_eq!(count("scan_start"), count("scan_end"));
    assert!(count("scan_start") > 0);
    assert!(!folder.join("s").exists(), "the socket is left");
}

#[test]
fn repeated_signals_are_merged() {
    use Signal as S;
    for (first, second, gap_ms) in [
        (S::TERM, S::TERM, 0),
        (S::TERM, S::TERM, 1),
        (S::TERM, S::TERM, 5),
        (S::TERM, S::TERM, 20),
        (S::INT, S::TERM, 2),
        (S::TERM, S::INT, 200),
        (S::INT, S::INT, 400),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let mut daemon = scanning(folder.path());
        daemon.signal(first);
        std::thread::sleep(Duration::from_millis(gap_ms));
        // It may have ended in time.
        let pid = Pid::from_raw(daemon.id().cast_signed()).expect("a process id");
        if daemon.child.try_wait().expect("it is ours").is_none() {
            kill_process(pid, second).expect("it runs");
        }
        let code = daemon.wait();
        assert_eq!(code, Some(0), "{first:?}, {second:?} after {gap_ms} ms: {}", daemon.messages());
        assert_closed(folder.path());
    }
}

/// A client that holds a stream open delays an orderly end by seconds.
#[test]
fn second_signal_forces_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    rig.plug("", 1);
    let options = rig.options();
    let options: Vec<&str> = options.iter().map(String::as_str).chain(FAST).collect();
    let mut daemon = Daemon::start(folder.path(), &options);
    wait_until("beams", || daemon.status()["scan"]["done"].as_u64() >= Some(2));
    // The stop command is not answered any more.
    let silent = rig.plug_silent();
    daemon.signal(Signal::TERM);
    std::thread::sleep(Duration::from_millis(700));
    if daemon.child.try_wait().expect("it is ours").is_none() {
        daemon.signal(Signal::TERM);
    }
    let code = daemon.wait();
    assert!(matches!(code, Some(0 | 1)), "{code:?}: {}", daemon.messages());
    drop(silent);
    assert_closed(folder.path());
}

/// Spawns a command as the leader of a session with a terminal of its own, and returns the terminal's other end. The program
/// ends with the terminal, although the tests may run under `nohup`.
fn with_terminal(wrapped: &std::process::Command) -> (std::process::Child, Pty) {
    let mut command = std::process::Command::new("env");
    command.arg("--default-signal=HUP").arg(wrapped.get_program()).args(wrapped.get_args());
    let changed = wrapped.get_envs().filter_map(|(name, value)| Some((name, value?)));
    command.envs(changed);
    let terminal = Pty::open(None).expect("a terminal");
    let name = terminal.path().to_owned();
    let side: OwnedFd =
        fs::OpenOptions::new().read(true).write(true).open(name).expect("opens").into();
    let own = side.try_clone().expect("a descriptor");
    #[allow(unsafe_code, reason = "between fork and exec, only system calls are made")]
    // SAFETY: setsid(2) and ioctl(2) are async-signal-safe.
    unsafe {
        command.pre_exec(move || {
            rustix::process::setsid()?;
            rustix::process::ioctl_tiocsctty(&own)?;
            Ok(())
        });
    }
    let child = command
        .stdin(Stdio::from(side.try_clone().expect("a descriptor")))
        .stdout(Stdio::from(side.try_clone().expect("a descriptor")))
        .stderr(Stdio::from(side))
        .spawn()
        .expect("the program starts");
    (child, terminal)
}

#[test]
fn closed_terminal_stops_daemon() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command =
        sonard(&["run", "--mock", "--scene", "simple-room", "--pose", "fig9", "--log"]);
    command.arg(folder.path().join("log")).arg("--socket").arg(folder.path().join("s")).args(FAST);
    let (child, terminal) = with_terminal(&command);
    let mut daemon = Daemon::from_child(child, folder.path());
    wait_until("beams", || daemon.status()["scan"]["done"].as_u64() >= Some(2));
    drop(terminal);
    assert_eq!(daemon.wait(), Some(0));
    assert_closed(folder.path());
}

#[test]
fn hangup_without_terminal_reloads() {
    let folder = tempfile::tempdir().expect("a folder");
    let command = without_terminal(sonard(&[]));
    let mock = ["--mock", "--scene", "simple-room", "--pose", "fig9"];
    let daemon = Daemon::start_as(command, folder.path(), &[&mock[..], &FAST].concat());
    daemon.signal(Signal::HUP);
    wait_until("the reload", || daemon.messages().contains("configuration reloaded"));
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn closed_terminal_stops_scan() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let mut command = sonard(&["scan", "--port", mock.port(), "--scene", "simple-room"]);
    command.args(["--pose", "fig9", "--max-range", "3", "--out"]).arg(folder.path().join("out"));
    let (mut child, terminal) = with_terminal(&command);
    let path = folder.path().join("out/scan.jsonl");
    wait_until("beams", || {
        fs::read_to_string(&path).is_ok_and(|text| text.matches("\"ping\"").count() > 3)
    });
    drop(terminal);
    wait_until("the end of the scan", || child.try_wait().expect("it is ours").is_some());
    assert_eq!(child.wait().expect("it ends").code(), Some(1));
    let log = Log::read(&path);
    assert_eq!(log.of_type("scan_end").count(), 1);
}
