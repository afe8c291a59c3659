//! No daemon goes on with a part of it dead: each long-lived task's end ends the process.

use std::{
    fs,
    os::unix::{net::UnixDatagram, process::ExitStatusExt as _},
    path::Path,
    process::{Command, ExitStatus},
    time::{Duration, Instant},
};

use sonard::supervisor::Task;

use super::{Daemon, logs, write_token};
use crate::common::{run, sonard, without_terminal};

/// A daemon on a mock in which `task` panics a second after its start, with all parts enabled that this build has.
fn start_with_panic(task: Task, folder: &Path) -> Daemon {
    // Without a terminal, SIGHUP reloads the configuration.
    let mut command: Command = without_terminal(sonard(&[]));
    command.env("SONARD_TEST_PANIC", task.name());
    fs::write(folder.join("air"), "21.0\n").expect("there is room");
    let token = write_token(folder, "0123456789abcdef0123456789abcdef");
    let [air, token] = [folder.join("air"), token].map(|path| path.display().to_string());
    let mut settings = vec![
        "scanning.mode=continuous".to_owned(),
        "plan.step_deg=9".to_owned(),
        "model.max_range_m=3".to_owned(),
        format!("air.file={air}"),
        "server.listen=127.0.0.1:0".to_owned(),
        format!("server.token_file={token}"),
        "foxglove.enabled=true".to_owned(),
        "fleet.daemons=other=127.0.0.1:9".to_owned(),
    ];
    if cfg!(feature = "mqtt") {
        settings.push("mqtt.broker=mqtt://127.0.0.1:9".to_owned());
    }
    if cfg!(feature = "ros") {
        settings.push("ros.enabled=true".to_owned());
    }
    let further: Vec<&str> =
        settings.iter().flat_map(|setting| ["--set", setting.as_str()]).collect();
    let mock = ["--mock", "--scene", "simple-room", "--pose", "fig9"];
    command.env("NOTIFY_SOCKET", folder.join("notify"));
    Daemon::spawn(command, folder, &[&mock[..], &further].concat())
}

fn wait_for_end(daemon: &mut Daemon, limit: Duration) -> Option<ExitStatus> {
    let since = Instant::now();
    while since.elapsed() < limit {
        if let Some(status) = daemon.child.try_wait().expect("it is ours") {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    None
}

/// Returns `true` if this build has a task.
fn is_built(task: Task) -> bool {
    (task != Task::Mqtt || cfg!(feature = "mqtt")) && (task != Task::Ros || cfg!(feature = "ros"))
}

#[test]
fn failed_task_ends_the_process() {
    for task in Task::ALL.into_iter().filter(|task| is_built(*task)) {
        let folder = tempfile::tempdir().expect("a folder");
        // Notifications need a recipient.
        let manager = UnixDatagram::bind(folder.path().join("notify"));
        let _manager = manager.expect("a socket");
        let mut daemon = start_with_panic(task, folder.path());
        let status = wait_for_end(&mut daemon, Duration::from_secs(30));
        let report = format!("the task \"{task}\" ended unexpectedly");
        // The reader of standard error may be behind.
        let since = Instant::now();
        let messages = loop {
            let messages = daemon.messages();
            if messages.contains(&report) || since.elapsed() > Duration::from_secs(10) {
                break messages;
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        let status =
            status.unwrap_or_else(|| panic!("{task} is dead and the daemon runs: {messages}"));
        assert_eq!((status.code(), status.signal()), (Some(3), None), "{task}: {messages}");
        assert!(messages.contains(&report), "{task}: {messages}");
        assert!(!messages.contains("panicked at"), "{task}: {messages}");
        assert!(!folder.path().join("s").exists(), "{task}: the socket is left");
        // A daemon that fails before its first record leaves the log empty.
        let written = logs(folder.path())
            .into_iter()
            .filter(|log| fs::metadata(log).is_ok_and(|log| log.len() > 0));
        for log in written {
            let verified = run(&["log", "verify", log.to_str().expect("plain path")]);
            assert_eq!(verified.status.code(), Some(0), "{task}");
        }
        // The device task itself is what writes the end of a scan, and the log's thread what keeps it.
        if ![Task::Device, Task::Log].contains(&task) {
            let text: String = logs(folder.path())
                .iter()
                .map(|log| fs::read_to_string(log).expect("text"))
                .collect();
            let count = |kind: &str| text.matches(&format!("{{\"type\":\"{kind}\"")).count();
            assert_eq!(count("scan_start"), count("scan_end"), "{task}: {messages}");
        }
    }
}
