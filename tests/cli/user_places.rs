//! Places of a daemon that a user without rights to the system's folders starts.

use std::{
    fs,
    os::unix::{
        fs::{PermissionsExt as _, chown},
        process::CommandExt as _,
    },
    path::Path,
    process::{Command, Stdio},
};

use crate::common::{interrupt, stderr, wait_until};

/// User and group without rights, as which tests of root run the program.
const UNPRIVILEGED: u32 = 65_534;

/// Command of `sonard` in the environment of a user with a home in `home`.
fn sonard(home: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sonard"));
    command
        .args(arguments)
        .env("HOME", home)
        .env("XDG_RUNTIME_DIR", home.join("run"))
        .env_remove("XDG_STATE_HOME")
        .env_remove("STATE_DIRECTORY")
        .env_remove("RUNTIME_DIRECTORY")
        .env_remove("SONARD_SERVER_SOCKET")
        .current_dir(home);
    if rustix::process::geteuid().is_root() {
        command.uid(UNPRIVILEGED).gid(UNPRIVILEGED);
    }
    command
}

/// Home of a user, with the folder of its session.
fn home() -> tempfile::TempDir {
    let home = tempfile::tempdir().expect("a folder");
    let run = home.path().join("run");
    fs::create_dir(&run).expect("there is room");
    if rustix::process::geteuid().is_root() {
        for folder in [home.path(), &run] {
            chown(folder, Some(UNPRIVILEGED), Some(UNPRIVILEGED)).expect("its owner");
        }
    }
    home
}

const MOCK: [&str; 6] = ["run", "--mock", "--virtual-time", "--scene", "simple-room", "--pose"];

#[test]
fn socket_and_logs_of_the_user() {
    let home = home();
    let mut daemon = sonard(home.path(), &[&MOCK[..], &["fig9"]].concat())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let socket = home.path().join("run/sonard/sonard.sock");
    wait_until("the socket", || socket.exists());
    let folder = fs::metadata(socket.parent().expect("a folder")).expect("it exists");
    assert_eq!(folder.permissions().mode() & 0o777, 0o700);
    let status = || sonard(home.path(), &["status"]).output().expect("it starts");
    wait_until("the status", || status().status.code() == Some(0));
    assert!(home.path().join(".local/state/sonard").is_dir());
    interrupt(daemon.id());
    let mut messages = String::new();
    std::io::Read::read_to_string(&mut daemon.stderr.take().expect("piped"), &mut messages)
        .expect("UTF-8");
    assert_eq!(daemon.wait().expect("it ends").code(), Some(0), "{messages}");
    assert!(messages.contains("run/sonard/sonard.sock"), "{messages}");
    assert!(!socket.exists());
    // The message of a client names the place where `sonard run` serves.
    let absent = status();
    assert_eq!(absent.status.code(), Some(3));
    assert!(stderr(&absent).contains("run/sonard/sonard.sock"), "{}", stderr(&absent));
}

#[test]
fn folder_of_another_user() {
    let home = home();
    let folder = home.path().join("run/sonard");
    fs::create_dir(&folder).expect("there is room");
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o777)).expect("permissions");
    let output = sonard(home.path(), &[&MOCK[..], &["fig9"]].concat()).output().expect("it starts");
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("belongs to another user"), "{}", stderr(&output));
}
