//! Hosts that lack inodes, threads, an address, or a service manager that reads its notifications.

use std::{
    fs,
    os::unix::{fs::PermissionsExt as _, net::UnixDatagram},
    path::Path,
    process::{Command, Stdio},
};

use rustix::process::geteuid;

use super::{Daemon, clean_log, write_token};
use crate::common::{program, sonard, stderr, wait_until};

const MOCK: [&str; 11] = [
    "--mock",
    "--scene",
    "simple-room",
    "--pose",
    "fig9",
    "--set",
    "scanning.mode=continuous",
    "--set",
    "model.max_range_m=3",
    "--set",
    "plan.step_deg=9",
];

/// Creates a command that runs a script in namespaces of its own, and in it the program as `"$@"`. `None` where that is
/// not permitted.
fn in_namespaces(script: &str) -> Option<Command> {
    let namespaces = ["--map-root-user", "--mount", "--net"];
    let permitted =
        Command::new("unshare").args(namespaces).arg("true").stderr(Stdio::null()).status();
    if !permitted.is_ok_and(|status| status.success()) {
        eprintln!("LEFT OUT, because no namespaces can be made here");
        return None;
    }
    let mut command = Command::new("unshare");
    command.args(namespaces).args(["sh", "-c", script, "sh"]).arg(program("sonard"));
    command.env("NO_COLOR", "1");
    Some(command)
}

#[test]
fn no_inodes_left() {
    let folder = tempfile::tempdir().expect("a folder");
    let logs = folder.path().join("log");
    fs::create_dir(&logs).expect("a folder");
    let mount =
        format!("mount -t tmpfs -o size=64m,nr_inodes=5 none {} && exec \"$@\"", logs.display());
    let Some(command) = in_namespaces(&mount) else { return };
    let rotating = ["--set", "log.rotate_mb=0.02"];
    let daemon = Daemon::start_as(command, folder.path(), &[&MOCK[..], &rotating].concat());
    wait_until("the limit", || daemon.status()["log"]["error"].to_string().contains("no inodes"));
    let log = daemon.status()["log"].clone();
    assert!(log["synced"].as_u64() <= log["written"].as_u64(), "{log}");
    let inside = format!("/proc/{}/root{}", daemon.id(), logs.display());
    let mut found: Vec<_> = fs::read_dir(inside).expect("readable").flatten().collect();
    found.sort_by_key(fs::DirEntry::path);
    fs::remove_file(found[0].path()).expect("it is there");
    wait_until("recovery", || daemon.status()["log"]["written"].as_u64() > log["written"].as_u64());
    // Records may wait for a file that cannot be created.
    let _code = daemon.stop();
}

#[test]
fn address_that_comes_later() {
    let folder = tempfile::tempdir().expect("a folder");
    let up = folder.path().join("up");
    // A namespace without any local address accepts all of them.
    let script = format!(
        "ip link set lo up; (for i in $(seq 600); do [ ! -e {} ] || break; sleep 0.1; done; \
         ip addr add 10.97.98.99/32 dev lo) & exec \"$@\"",
        up.display()
    );
    let Some(command) = in_namespaces(&script) else { return };
    let token = write_token(folder.path(), "0123456789abcdef0123456789abcdef");
    let token = format!("server.token_file={}", token.display());
    let listen = ["--set", "server.listen=10.97.98.99:8765", "--set", &token];
    let daemon = Daemon::start_as(command, folder.path(), &[&MOCK[..], &listen].concat());
    let is_reported = || daemon.status().to_string().contains("cannot be bound yet");
    wait_until("the report", is_reported);
    daemon.wait_for_scans(1);
    fs::write(&up, "").expect("there is room");
    wait_until("the address", || !is_reported());
    assert_eq!(daemon.stop(), Some(0));
    clean_log(folder.path());
}

#[test]
fn too_few_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o777)).expect("ours");
    // The limit does not apply to root.
    let user = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"];
    let user = if geteuid().is_root() { &user[..] } else { &["env"] };
    let run = |threads: u32, arguments: &[&str]| {
        let limit = format!("--nproc={threads}");
        let limited = Command::new("prlimit")
            .arg(limit)
            .args(user)
            .arg(program("sonard"))
            .args(arguments)
            .output();
        limited.expect("prlimit of util-linux")
    };
    if !run(100, &["--version"]).status.success() {
        eprintln!("LEFT OUT, because another user cannot run the program");
        return;
    }
    let [log, socket] = ["log", "s"].map(|name| folder.path().join(name).display().to_string());
    for threads in 1..=4 {
        let arguments = [&["run", "--log", &log, "--socket", &socket], &MOCK[..]].concat();
        let output = run(threads, &arguments);
        let messages = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{threads} threads: {messages}");
        assert!(
            messages.contains("threads") && messages.contains("TasksMax="),
            "{threads}: {messages}"
        );
        assert!(
            !messages.contains("internal error") && !messages.contains("panicked"),
            "{messages}"
        );
        assert!(!Path::new(&socket).exists());
    }
}

#[test]
fn manager_that_does_not_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("notify");
    let _manager = UnixDatagram::bind(&path).expect("a socket");
    let mut command = sonard(&[]);
    // Fills the queue of the socket within a second.
    command.env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", "30000").env_remove("WATCHDOG_PID");
    let daemon = Daemon::start_as(command, folder.path(), &MOCK);
    daemon.wait_for_scans(2);
    assert_eq!(daemon.stop(), Some(0));
    clean_log(folder.path());
}
