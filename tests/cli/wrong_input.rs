//! Wrong input: each gives one clear message that says what to do, and the right exit code.

use std::{
    fs,
    io::Write as _,
    os::unix::{fs::PermissionsExt as _, process::CommandExt as _},
    process::Stdio,
    time::Duration,
};

use crate::common::{MockProcess, mock_scan, run, sonard, stderr};
use sonard::link::Pty;

/// Runs `arguments` and checks exit code and what the message must contain.
#[track_caller]
fn check(arguments: &[&str], code: i32, parts: &[&str]) {
    let output = run(arguments);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    // Wrapped lines are one message.
    let message = message.replace(['\n', '│'], " ");
    let message = message.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in parts {
        assert!(message.contains(part), "{arguments:?}: {part:?} is not in: {message}");
    }
    assert!(!message.contains("panicked"), "{message}");
}

fn scan_of<'a>(scene: &'a str, pose: &'a str, further: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec!["scan", "--mock", "--scene", scene, "--pose", pose];
    arguments.extend(further);
    arguments
}

#[test]
fn ports() {
    let port = |port| ["scan", "--port", port, "--scene", "simple-room", "--pose", "fig9"];
    check(&port("/dev/no-such-port"), 3, &["no serial port", "/dev/no-such-port", "--mock"]);
    for no_port in ["/etc/hostname", "/etc", "/dev/null", "/dev/zero", "/dev/ptmx"] {
        let named = format!("{no_port} is not a serial port");
        check(&port(no_port), 3, &[&named, "/dev/ttyACM0"]);
    }
    check(&["scan", "--scene", "simple-room", "--pose", "fig9"], 2, &["--port", "--mock"]);
}

#[test]
fn an_option_of_another_engine_is_refused_by_name() {
    let simulate = ["simulate", "--scene", "simple-room", "--pose", "fig9", "--to-deg", "9"];
    for (engine, option, knowing) in [
        ("cone", &["--lossless"][..], "--engine paths or --engine fan"),
        ("cone", &["--max-order", "2"], "--engine paths or --engine fan"),
        ("cone", &["--response", "full"], "--engine paths"),
        ("fan", &["--edge-law", "utd"], "--engine paths"),
        ("fan", &["--aperture-deg", "15"], "--engine cone"),
        ("fan", &["--ideal-receiver"], "--engine paths"),
        ("fan", &["--double-diffraction"], "--engine paths"),
        ("paths", &["--ray-spacing-deg", "0.1"], "--engine fan"),
        ("paths", &["--aperture-deg", "15"], "--engine cone"),
    ] {
        let wrong = [&simulate[..], &["--engine", engine], option].concat();
        check(&wrong, 2, &[option[0], &format!("{engine} does not know it"), knowing]);
    }
}

#[test]
fn a_port_without_permission() {
    let pty = Pty::open(None).expect("a pty");
    fs::set_permissions(pty.path(), fs::Permissions::from_mode(0o000)).expect("it is ours");
    let path = pty.path().to_str().expect("plain path");
    let mut scan = sonard(&["scan", "--port", path, "--scene", "simple-room", "--pose", "fig9"]);
    if rustix::process::geteuid().is_root() {
        // Root may open anything: try as somebody who may not, from where that one may be.
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
fn a_busy_port() {
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
fn a_port_where_nothing_answers_and_one_that_speaks_something_else() {
    let silent = Pty::open(None).expect("a pty");
    let path = silent.path().to_str().expect("plain path").to_owned();
    let arguments = ["scan", "--port", &path, "--scene", "simple-room", "--pose", "fig9"];
    check(&arguments, 3, &["did not answer", "cable"]);

    let gps = Pty::open(None).expect("a pty");
    let path = gps.path().to_str().expect("plain path").to_owned();
    let talking = std::thread::spawn(move || {
        for _ in 0..200 {
            // A full pty only means that nobody listens yet.
            let _ = gps.write(b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M\r\n");
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    let arguments = ["scan", "--port", &path, "--scene", "simple-room", "--pose", "fig9"];
    check(&arguments, 3, &["no frame", "not a sonard device"]);
    talking.join().expect("talks");
}

#[test]
fn scenes_and_poses() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = |text: &str| {
        let path = folder.path().join("room.json");
        fs::write(&path, text).expect("writes");
        path.to_str().expect("plain path").to_owned()
    };
    let good = include_str!("../../scenes/simple-room.json");
    let unknown = scene(&good.replacen("\"reflectance\"", "\"reflectence\"", 1));
    check(&scan_of(&unknown, "fig9", &[]), 2, &["room.json", "reflectence", "reflectance"]);
    let last = good.rfind('}').expect("an object");
    let unclosed = scene(&good[..last]);
    check(&scan_of(&unclosed, "fig9", &[]), 2, &["room.json"]);
    check(&scan_of("no-such-room", "fig9", &[]), 2, &["no-such-room", "simple-room"]);
    check(&scan_of("simple-room", "fig8", &[]), 2, &["fig8", "fig7", "fig9"]);
    check(&scan_of("simple-room", "3,3,0", &[]), 2, &["outside"]);
    check(&scan_of("simple-room", "a,b", &[]), 2, &["X,Y,DEG"]);
}

#[test]
fn plans_and_settings() {
    let scan = |further: &[&'static str]| scan_of("simple-room", "fig9", further);
    check(&scan(&["--step-deg", "1"]), 2, &["step_deg 1", "0.9"]);
    check(&scan(&["--step-deg", "0"]), 2, &["step_deg"]);
    check(&scan(&["--to-deg", "-10"]), 2, &["to_deg"]);
    check(&scan(&["--pings-per-stop", "0"]), 2, &["pings_per_stop"]);
    check(&scan(&["--temperature-c", "900"]), 2, &["temperature"]);
    check(&scan(&["--sensor", "no-such"]), 2, &["senscomp-6500"]);
    check(&scan(&["--faults", "flop=1"]), 2, &["flop"]);
}

#[test]
fn output_folders() {
    let scan = |out| {
        [
            "scan",
            "--mock",
            "--scene",
            "simple-room",
            "--pose",
            "fig9",
            "--to-deg",
            "9",
            "--out",
            out,
        ]
    };
    check(&scan("/proc/sonard-out"), 2, &["/proc/sonard-out", "may write"]);
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    fs::write(&file, "data").expect("writes");
    check(&scan(file.to_str().expect("plain path")), 2, &["file"]);
    assert_eq!(fs::read(&file).expect("kept"), b"data");
}

#[test]
fn a_log_in_use_is_not_shared() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("scan.jsonl");
    let _held = sonard::store::LogWriter::open(&log).expect("opens");
    let output = mock_scan("fig9", folder.path(), &["--to-deg", "9"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("another process"), "{}", stderr(&output));
}

#[test]
fn a_reader_that_goes_away_is_no_failure_worth_a_backtrace() {
    let mut scan = sonard(&["scan", "--mock", "--scene", "simple-room", "--pose", "fig9"]);
    let mut child = scan.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("ends");
    assert!(!stderr(&output).contains("panicked"), "{}", stderr(&output));
    std::io::stdout().flush().expect("flushes");
}
