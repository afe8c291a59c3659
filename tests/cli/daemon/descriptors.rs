//! Clients that hold all descriptors they can get.

use std::{
    io::{Read as _, Write as _},
    os::unix::{net::UnixStream, process::CommandExt as _},
    time::Duration,
};

use rustix::process::{Resource, Rlimit, setrlimit};
use sonard::mock::Pace;

use super::{Daemon, clean_log, rig::Rig};
use crate::common::{sonard, wait_until};

#[test]
fn descriptors_are_reserved() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rig = Rig::new(folder.path(), Pace::RealTime);
    rig.plug("", 1);
    let mut command = sonard(&[]);
    #[allow(unsafe_code, reason = "between fork and exec, only a system call is made")]
    // SAFETY: setrlimit(2) is async-signal-safe.
    unsafe {
        command.pre_exec(|| {
            let limit = Rlimit { current: Some(40), maximum: Some(40) };
            setrlimit(Resource::Nofile, limit).map_err(Into::into)
        });
    }
    let options = rig.options();
    let mut options: Vec<&str> = options.iter().map(String::as_str).collect();
    for setting in [
        "scanning.mode=continuous",
        "plan.step_deg=9",
        "log.rotate_mb=0.02",
        "server.max_clients=64",
    ] {
        options.extend(["--set", setting]);
    }
    let daemon = Daemon::start_as(command, folder.path(), &options);
    daemon.wait_for_scans(1);
    let scans = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    let clients: Vec<UnixStream> = (0..60)
        .filter_map(|_| {
            let mut client = daemon.connect().ok()?;
            let request = b"GET /v1/live/records HTTP/1.1\r\nHost: localhost\r\n\r\n";
            client.write_all(request).ok()?;
            Some(client)
        })
        .collect();
    // The ranger disconnects and comes back while they hold what they have; logs are rotated.
    let logs_before = super::logs(folder.path()).len();
    rig.unplug();
    std::thread::sleep(Duration::from_millis(500));
    rig.plug("", 2);
    wait_until("another log", || super::logs(folder.path()).len() > logs_before + 1);
    drop(clients);
    wait_until("a place for a client", || is_answered(&daemon));
    daemon.wait_for_scans(scans + 2);
    assert_eq!(daemon.stop(), Some(0));
    clean_log(folder.path());
}

/// Returns `true` if a request is answered: a client beyond the limit gets 503, or its connection is closed.
fn is_answered(daemon: &Daemon) -> bool {
    let Ok(mut client) = daemon.connect() else { return false };
    let request = b"GET /v1/health HTTP/1.0\r\nHost: localhost\r\n\r\n";
    let mut answer = String::new();
    let answered = client.write_all(request).and_then(|()| client.read_to_string(&mut answer));
    answered.is_ok() && answer.contains("\"healthy\"")
}
