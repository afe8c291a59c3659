//! Serial ports of `sonard scan`: missing, forbidden, busy, or with another device.

use std::{
    fs,
    os::unix::{fs::PermissionsExt as _, process::CommandExt as _},
    process::Stdio,
    time::Duration,
};

use crate::{
    common::{MockProcess, sonard, stderr},
    scan_input::check,
};
use sonard::link::Pty;

#[test]
fn missing_ports_and_other_files() {
    let port = |port| ["scan", "--port", port, "--scene", "simple-room", "--pose", "fig9"];
    check(&port("/dev/no-such-port"), 3, &["no serial port", "/dev/no-such-port", "--mock"]);
    for no_port in ["/etc/hostname", "/etc", "/dev/null", "/dev/zero", "/dev/ptmx"] {
        let named = format!("{no_port} is not a serial port");
        check(&port(no_port), 3, &[&named, "/dev/ttyACM0"]);
    }
    check(&["scan", "--scene", "simple-room", "--pose", "fig9"], 2, &["--port", "--mock"]);
}

#[test]
fn port_without_permission() {
    let pty = Pty::open(None).expect("a pty");
    fs::set_permissions(pty.path(), fs::Permissions::from_mode(0o000)).expect("it is ours");
    let path = pty.path().to_str().expect("plain path");
    let mut scan = sonard(&["scan", "--port", path, "--scene", "simple-room", "--pose", "fig9"]);
    if rustix::process::geteuid().is_root() {
        // Root may open any file: run as an unprivileged user, in a folder that this user may enter.
        let copy = tempfile::tempdir_in("/tmp").expect("a folder");
        fs::set_permissions(copy.path(), fs::Permissions::from_mode(0o755)).expect("ours");
        let program = copy.path().join("sonard");
        fs::copy(env!("CARGO_BIN_EXE_sonard"), &program).expect("copies");
        let mut other = std::process::Command::new(&program);
        other.args(scan.get_args()).current_dir("/tmp").uid(65_534).gid(65_534);
        scan = other;
        let output = scan.output().expect("starts");
        return assert_forbidden(&output);
    }
    assert_forbidden(&scan.output().expect("starts"));
}

#[track_caller]
fn assert_forbidden(output: &std::process::Output) {
    let message = stderr(output);
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(message.contains("permission") && message.contains("dialout"), "{message}");
}

#[test]
fn busy_port() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let arguments = ["scan", "--port", mock.port(), "--scene", "simple-room", "--pose", "fig9"];
    let mut first =
        sonard(&arguments).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("starts");
    // Once it has written something, it has the port.
    let mut byte = [0];
    std::io::Read::read_exact(first.stdout.as_mut().expect("piped"), &mut byte).expect("writes");
    let holder = format!("(pid {})", first.id());
    check(&arguments, 3, &["in use by another program", "fuser", &holder]);
    first.kill().expect("it runs");
    first.wait().expect("it ends");
}

#[test]
fn no_reply_and_foreign_device() {
    let silent = Pty::open(None).expect("a pty");
    let path = silent.path().to_str().expect("plain path").to_owned();
    let arguments = ["scan", "--port", &path, "--scene", "simple-room", "--pose", "fig9"];
    check(&arguments, 3, &["no reply", "cable"]);

    let gps = Pty::open(None).expect("a pty");
    let path = gps.path().to_str().expect("plain path").to_owned();
    let talking = std::thread::spawn(move || {
        for _ in 0..200 {
            // A full pty only means that there is no reader yet.
            let _ = gps.write(b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M\r\n");
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    let arguments = ["scan", "--port", &path, "--scene", "simple-room", "--pose", "fig9"];
    check(&arguments, 3, &["no valid frame", "not a sonard device"]);
    talking.join().expect("talks");
}
