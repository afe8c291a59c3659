//! Diagnoses of `sonard doctor`.

use std::{
    io::{ErrorKind, Write as _},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use firmware_protocol::messages::{Echoes, Reply};
use serde_json::Value;
use sonard::link::Pty;

use crate::{
    common::{MockProcess, run, stderr},
    tamper::Tampered,
};

/// Examines a mock with such faults; exit code and report.
fn examine(further: &[&str], options: &[&str]) -> (Option<i32>, Value) {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), further);
    doctor(mock.port(), options)
}

fn doctor(port: &str, options: &[&str]) -> (Option<i32>, Value) {
    let arguments = [&["doctor", "--json", "--port", port][..], options].concat();
    let output = run(&arguments);
    let report = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", stderr(&output)));
    (output.status.code(), report)
}

/// Returns the checks without success, as `check cause status`, except for late replies, which a
/// busy computer causes.
fn findings(report: &Value) -> Vec<String> {
    let is_load = |finding: &String| finding.starts_with("line ") && finding.ends_with(" warning");
    all_findings(report).into_iter().filter(|finding| !is_load(finding)).collect()
}

/// Returns the checks without success, as `check cause status`.
fn all_findings(report: &Value) -> Vec<String> {
    let checks = report["checks"].as_array().expect("checks");
    let text = |check: &Value, key: &str| check[key].as_str().unwrap_or("null").to_owned();
    for check in checks.iter().filter(|check| !check["cause"].is_null()) {
        assert!(check["help"].as_str().is_some_and(|help| help.len() > 20), "{check}");
    }
    checks
        .iter()
        .filter(|check| !["ok", "skipped"].contains(&&text(check, "status")[..]))
        .map(|check| {
            format!("{} {} {}", text(check, "check"), text(check, "cause"), {
                text(check, "status")
            })
        })
        .collect()
}

#[test]
fn healthy_ranger() {
    let (code, report) = examine(&[], &[]);
    assert_eq!(findings(&report), [""; 0], "{report:#}");
    assert_eq!(code, Some(0));
    let names: Vec<&str> = report["checks"]
        .as_array()
        .expect("checks")
        .iter()
        .filter_map(|check| check["check"].as_str())
        .collect();
    assert_eq!(names, ["port", "board", "restart", "line", "motor", "echo", "clock"]);
    assert!(report["checks"][1]["detail"].as_str().expect("text").contains("mock"));
    assert!(report["checks"][5]["detail"].as_str().expect("text").contains("10 of 10"));
}

#[test]
fn faults_and_causes() {
    let cases: [(&str, &[&str], &str, i32); 12] = [
        // A supply that sags as the motor turns, whichever turn it is.
        ("motor_reset=1", &[], "motor power failed", 1),
        ("motor_reset=0.4", &[], "motor power failed", 1),
        ("motor_hangup=1", &[], "motor cable failed", 3),
        ("lie=endless-home", &[], "motor device failed", 1),
        ("lie=far-home", &[], "motor device failed", 1),
        ("lie=no-steps", &[], "board wrong_firmware failed", 3),
        ("lie=slow-ticks", &[], "board wrong_firmware failed", 3),
        ("no_echo=1", &["--no-motion"], "echo missing_echo failed", 1),
        ("stuck_echo=1", &["--no-motion"], "echo stuck_echo failed", 1),
        ("reset=1", &[], "echo power failed", 1),
        ("hangup=1", &["--no-motion"], "echo cable failed", 3),
        ("version=9", &[], "board wrong_version failed", 3),
    ];
    for (faults, options, expected, code) in cases {
        let (exit, report) = examine(&["--faults", faults], options);
        assert_eq!(findings(&report), [expected], "{faults}: {report:#}");
        assert_eq!(exit, Some(code), "{faults}");
    }
}

#[test]
fn clock_rate() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let options = ["--no-motion", "--pings", "1"];
    let (code, report) = doctor(mock.port(), &options);
    assert_eq!((findings(&report), code), (vec![], Some(0)), "{report:#}");
    assert_eq!(report["checks"][6]["status"], "ok", "{report:#}");
    for (rate, printed) in [(0_u32, "is stopped"), (2, "2.0")] {
        let change = move |reply: &mut Reply| {
            if let Reply::StatusReport(status) = reply {
                status.ticks = status.ticks.wrapping_mul(rate);
            }
        };
        let line = Tampered::start(mock.port(), Box::new(change));
        let (code, report) = doctor(line.port(), &options);
        let found = findings(&report);
        assert!(found.iter().any(|finding| *finding == "clock clock failed"), "{report:#}");
        // The host may reject readings of such a clock, too.
        let expected = ["clock clock failed", "echo device failed"];
        assert!(found.iter().all(|finding| expected.contains(&&**finding)), "{report:#}");
        assert!(
            report["checks"][6]["detail"].as_str().expect("text").contains(printed),
            "{report:#}"
        );
        assert_eq!(code, Some(1));
    }
}

#[test]
fn impossible_and_scattered_echoes() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &[]);
    // An echo at 1 mm, and one at 172 m; readings that wander by 0.7 m.
    type Echo = fn(u32) -> u32;
    let cases: [(Echo, &[&str]); 3] = [
        (|_| 12, &["echo_time"]),
        // The host may reject such a reading as well.
        (|_| 2_000_000, &["echo_time", "device"]),
        (|firing| 8_000 + firing % 10 * 900, &["scatter"]),
    ];
    for (echo_ticks, causes) in cases {
        let mut firing = 0;
        let change = move |reply: &mut Reply| {
            if let Reply::Reading(reading) = reply {
                firing += 1;
                reading.echoes = Echoes::from_ticks(&[echo_ticks(firing)]);
            }
        };
        let line = Tampered::start(mock.port(), Box::new(change));
        let (code, report) = doctor(line.port(), &["--no-motion"]);
        let found = findings(&report);
        let expected = causes.iter().any(|cause| found == [format!("echo {cause} failed")]);
        assert!(expected, "{found:?}: {report:#}");
        assert_eq!(code, Some(1));
    }
}

#[test]
fn late_replies_are_not_lost() {
    let slow = ["--faults", "delay=1,delay_ms=150"];
    let (code, report) = examine(&slow, &["--no-motion", "--pings", "1"]);
    assert_eq!(all_findings(&report), ["line latency warning"], "{report:#}");
    assert_eq!(code, Some(0));
}

#[test]
fn lossy_line() {
    let (code, report) = examine(&["--faults", "flip=0.004"], &["--pings", "2"]);
    assert_eq!(all_findings(&report), ["line line warning"], "{report:#}");
    assert_eq!(code, Some(0));
}

#[test]
fn missed_steps() {
    let (code, report) = examine(&["--missed-steps", "1"], &["--pings", "1"]);
    assert_eq!(findings(&report), ["motor motor failed"], "{report:#}");
    assert_eq!(code, Some(1));
}

/// A port with another device, or a silent one.
fn stranger(has_text: &'static [u8]) -> (Option<i32>, Value) {
    let pty = Pty::open(None).expect("a pty");
    let port = pty.path().to_str().expect("plain path").to_owned();
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let speaking = std::thread::spawn(move || {
        let mut buffer = [0; 256];
        while !stopped.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(100));
            match pty.read(&mut buffer) {
                Ok(_) => {}
                Err(error) => assert_eq!(error.kind(), ErrorKind::WouldBlock),
            }
            // A full pty drops unread bytes.
            drop(pty.write(has_text));
        }
    });
    let found = doctor(&port, &[]);
    stop.store(true, Ordering::Relaxed);
    speaking.join().expect("speaks to the end");
    found
}

#[test]
fn no_reply_and_other_firmware() {
    let (code, report) = stranger(b"");
    assert_eq!(findings(&report), ["board silent failed"], "{report:#}");
    assert_eq!(code, Some(3));
    for (has_text, cause, name) in [
        (&b"$GPGGA,123519,4807.038,N,01131.000,E*47\r\n"[..], "wrong_firmware", "GPS"),
        (b"\r\nDebian GNU/Linux robot ttyS0\r\n\r\nrobot login: ", "login_prompt", "robot login:"),
        (b"AT\r\nAT+GCAP\r\n", "modem", "modem commands"),
        (b"\r\nERROR\r\n", "modem", "a modem replies"),
        (&[0xf8, 0x80, 0xe6, 0x98], "wrong_firmware", "nor frames"),
    ] {
        let (code, report) = stranger(has_text);
        assert_eq!(findings(&report), [format!("board {cause} failed")], "{report:#}");
        assert!(detail(&report, "board").contains(name), "{report:#}");
        assert_eq!(code, Some(3));
    }
}

/// A check's detail and help.
fn detail(report: &Value, name: &str) -> String {
    let checks = report["checks"].as_array().expect("checks");
    let check = checks.iter().find(|check| check["check"] == name).expect("the check");
    format!("{} {}", check["detail"], check["help"])
}

/// A program that has a port open, until dropped.
struct Holder(std::process::Child);

impl Holder {
    /// Starts a shell command with the port as its standard input and output.
    fn start(port: &str, command: &str) -> Self {
        let file = std::fs::OpenOptions::new().read(true).write(true).open(port).expect("opens");
        let output = file.try_clone().expect("a descriptor");
        let mut shell = std::process::Command::new("sh");
        Self(shell.args(["-c", command]).stdin(file).stdout(output).spawn().expect("starts"))
    }
}

impl Drop for Holder {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

#[test]
fn reading_program_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &[]);
    let holder = Holder::start(mock.port(), "exec cat >/dev/null");
    let named = format!("`cat` (pid {})", holder.0.id());
    let (code, report) = doctor(mock.port(), &[]);
    assert_eq!(findings(&report), ["port busy failed"], "{report:#}");
    assert_eq!(code, Some(3));
    assert!(detail(&report, "port").contains(&named), "{report:#}");
    assert!(!report.to_string().contains("firmware"), "{report:#}");

    let scan = ["scan", "--port", mock.port(), "--scene", "simple-room", "--pose", "fig9"];
    let output = run(&[&scan[..], &["--to-deg", "9"]].concat());
    // Which of the two gets a byte is chance: either the scan ends well, or its end is explained.
    let text = stderr(&output);
    assert!(output.status.success() || text.contains(&named), "{text}");

    drop(holder);
    let (code, report) = doctor(mock.port(), &["--no-motion", "--pings", "1"]);
    assert_eq!((findings(&report), code), (vec![], Some(0)), "{report:#}");
}

#[test]
fn few_descriptors() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &[]);
    let mut named = 0;
    for limit in 4..28 {
        let program = env!("CARGO_BIN_EXE_sonard");
        let port = mock.port();
        let command = format!(
            "ulimit -n {limit}; {program} doctor; exec {program} doctor --port {port} --no-motion --pings 1"
        );
        let output = std::process::Command::new("sh").args(["-c", &command]).output();
        let output = output.expect("the shell starts");
        let text = String::from_utf8_lossy(&output.stdout).into_owned() + &stderr(&output);
        assert!(!text.contains("panicked"), "{limit}: {text}");
        assert!(!text.contains("has it open, too"), "{limit}: {text}");
        let code = output.status.code();
        assert!(
            code == Some(0) || text.contains("Too many open files"),
            "{limit}: {code:?} {text}"
        );
        named += u32::from(code != Some(0));
    }
    assert!(named > 0, "the limits are too generous for this test");
}

#[test]
fn locking_program_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &[]);
    let lock = "flock --exclusive 1 && exec sleep 60";
    let holder = Holder::start(mock.port(), lock);
    std::thread::sleep(Duration::from_millis(500));
    let (code, report) = doctor(mock.port(), &[]);
    assert_eq!(findings(&report), ["port busy failed"], "{report:#}");
    assert_eq!(code, Some(3));
    assert!(detail(&report, "port").contains(&format!("(pid {})", holder.0.id())), "{report:#}");
}

#[test]
fn changed_port_settings() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let port = mock.port().to_owned();
    // The other end of a pseudo-terminal may change them, too, and is not kept out by a lock.
    let change = "import os,sys,termios,time\ntime.sleep(0.7)\n\
        d=os.open(sys.argv[1], os.O_RDWR|os.O_NOCTTY)\n\
        s=termios.tcgetattr(d)\ns[4]=s[5]=termios.B9600\n\
        termios.tcsetattr(d, termios.TCSANOW, s)\n";
    let mut changing =
        std::process::Command::new("python3").args(["-c", change, &port]).spawn().expect("starts");
    let (code, report) = doctor(&port, &["--no-motion"]);
    if !changing.wait().expect("it ends").success() {
        eprintln!("LEFT OUT: only root may open a port that is in use");
        return;
    }
    assert_eq!(findings(&report), ["settings settings failed"], "{report:#}");
    assert!(detail(&report, "settings").contains("9600 instead of 115200"), "{report:#}");
    assert_eq!(code, Some(3));
}

#[test]
fn missing_wrong_and_busy_ports() {
    let (code, report) = doctor("/dev/no-such-port", &[]);
    assert_eq!(findings(&report), ["port not_found failed"]);
    assert_eq!(code, Some(3));
    let mut file = tempfile::NamedTempFile::new().expect("a file");
    file.write_all(b"data").expect("writes");
    let (_, report) = doctor(file.path().to_str().expect("plain path"), &[]);
    assert_eq!(findings(&report), ["port not_serial failed"]);
    let pty = Pty::open(None).expect("a pty");
    let port = pty.path().to_str().expect("plain path");
    let runtime = tokio::runtime::Runtime::new().expect("a runtime");
    let _inside = runtime.enter();
    let held = sonard::link::open(port).expect("opens");
    let (code, report) = doctor(port, &[]);
    assert_eq!(findings(&report), ["port busy failed"], "{report:#}");
    assert_eq!(code, Some(3));
    drop(held);
}

#[test]
fn lists_ports_without_opening() {
    let output = run(&["doctor", "--json"]);
    let listed: Value = serde_json::from_slice(&output.stdout).expect("an object");
    let empty = listed["candidates"].as_array().expect("a list").is_empty();
    assert_eq!(output.status.code(), Some(if empty { 3 } else { 0 }));
    assert!(listed["port"].is_null());
}

#[test]
fn missing_emulator() {
    let scan = ["scan", "--emulator", "--scene", "simple-room", "--pose", "fig9"];
    let output = crate::common::sonard(&scan)
        .env("SONARD_EMULATOR", "/no/such/emulator")
        .output()
        .expect("the program starts");
    assert_eq!(output.status.code(), Some(3));
    let text = stderr(&output);
    assert!(text.contains("/no/such/emulator") && text.contains("firmware/test.sh"), "{text}");
    let output = run(&[&scan[..], &["--faults", "flip=0.1"]].concat());
    assert_ne!(output.status.code(), Some(0), "the emulator has no faults of the line");
}
