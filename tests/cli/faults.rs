//! Scans under faults of line and device.

use std::{process::Stdio, time::Duration};

use crate::common::{Log, MockProcess, interrupt, mock_scan, run, sonard, stderr, wait_until};

#[test]
fn noisy_line_loses_no_data() {
    for (seed, faults) in [
        ("1", "flip=0.003"),
        ("2", "drop=0.003"),
        ("3", "double=0.003"),
        ("4", "flip=0.001,drop=0.001,double=0.001,delay=0.02,delay_ms=15"),
        ("5", "stall=0.005,stall_ms=200"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let further = ["--faults", faults, "--seed", seed, "--max-range", "3", "--noise-mm", "0"];
        let output = mock_scan("fig9", folder.path(), &further);
        assert_eq!(output.status.code(), Some(0), "{faults}: {}", stderr(&output));
        let log = Log::read(&folder.path().join("scan.jsonl"));
        log.assert_each_beam_once(400);
        for ping in log.pings() {
            let residual_m = ping["residual_m"].as_f64().unwrap_or(0.0);
            assert!(residual_m.abs() < 0.001, "{faults}: a wrong reading: {ping}");
        }
    }
}

#[test]
fn restart_is_recovered() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = mock_scan("fig9", folder.path(), &["--faults", "reset=0.01", "--seed", "3"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    log.assert_each_beam_once(400);
    let reboots = log.events().iter().filter(|event| event.contains("reboot")).count();
    assert!(reboots >= 2, "{:?}", log.events());
    assert!(stderr(&output).contains("the device reset"));
}

#[test]
fn restart_loop_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = mock_scan("fig9", folder.path(), &["--faults", "reset=1"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("supply"), "{}", stderr(&output));
}

#[test]
fn hangup_counts_missing_beams() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = mock_scan("fig9", folder.path(), &["--faults", "hangup=0.02", "--seed", "1"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("closed"), "{}", stderr(&output));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    log.assert_each_beam_once(400);
    let lost = log.pings().iter().filter(|ping| ping["status"] == "link_lost").count();
    assert_eq!(log.end()["missing"], lost);
    assert_eq!(log.end()["beams"], 400 - lost);
    assert!(lost > 0);
}

#[test]
fn other_protocol_version() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = mock_scan("fig9", folder.path(), &["--faults", "version=9"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("protocol 9"), "{}", stderr(&output));
}

#[test]
fn interrupt_closes_the_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let out = folder.path().join("out");
    let scan = sonard(&["scan", "--port", mock.port(), "--scene", "simple-room", "--pose", "fig9"])
        .args(["--max-range", "4", "--out"])
        .arg(&out)
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    let log_path = out.join("scan.jsonl");
    wait_until("some readings", || {
        std::fs::read_to_string(&log_path).is_ok_and(|log| log.matches("\"ping\"").count() >= 20)
    });
    interrupt(scan.id());
    let output = scan.wait_with_output().expect("ends");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let log = Log::read(&log_path);
    assert!(log.events().iter().any(|event| event.contains("stopped")), "{:?}", log.events());
    let beams = log.pings().len();
    assert_eq!(log.end()["beams"], beams);
    assert_eq!(log.end()["missing"], 400 - beams);
    assert!(out.join("scan.png").exists(), "what was measured is drawn");
    let verified = run(&["log", "verify", log_path.to_str().expect("plain path")]);
    assert!(!stderr(&verified).contains("torn"));
    let (_, printed) = mock.stop();
    // The device stopped on request: it neither went on nor waited for its lease to end.
    assert!(!printed.contains("400 firings") && !printed.contains("coils released"), "{printed}");
}

#[test]
fn killed_host_expires_the_lease() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let log_path = folder.path().join("out/scan.jsonl");
    let mut scan = sonard(&["scan", "--port", mock.port(), "--scene", "simple-room"])
        .args(["--pose", "fig9", "--max-range", "4", "--out"])
        .arg(folder.path().join("out"))
        .stderr(Stdio::null())
        .spawn()
        .expect("starts");
    wait_until("some readings", || {
        std::fs::read_to_string(&log_path).is_ok_and(|log| log.matches("\"ping\"").count() >= 20)
    });
    scan.kill().expect("it runs");
    scan.wait().expect("it ends");
    // The lease is two seconds; a second scan finds a device that answers.
    std::thread::sleep(Duration::from_millis(2_500));
    let again = run(&[
        "scan",
        "--port",
        mock.port(),
        "--scene",
        "simple-room",
        "--pose",
        "fig9",
        "--max-range",
        "4",
        "--to-deg",
        "9",
    ]);
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
    let (_, printed) = mock.stop();
    assert!(printed.contains("coils released"), "{printed}");
}

#[test]
fn left_over_sweep_is_stopped() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = MockProcess::start(folder.path(), &["--realtime"]);
    let place = ["--port", mock.port(), "--scene", "simple-room", "--pose", "fig9"];
    let short = ["--max-range", "4", "--to-deg", "9"];
    let after: [(&str, Vec<&str>); 3] = [
        ("scan", [&["scan"], &place[..], &short[..]].concat()),
        ("doctor", vec!["doctor", "--port", mock.port(), "--no-motion", "--pings", "2"]),
        ("scan", [&["scan"], &place[..], &short[..]].concat()),
    ];
    for (number, (name, arguments)) in after.iter().enumerate() {
        let out = folder.path().join(format!("out{number}"));
        let mut scan = sonard(&[&["scan"], &place[..]].concat())
            .args(["--max-range", "4", "--out"])
            .arg(&out)
            .stderr(Stdio::null())
            .spawn()
            .expect("starts");
        wait_until("some readings", || {
            std::fs::read_to_string(out.join("scan.jsonl"))
                .is_ok_and(|log| log.matches("\"ping\"").count() >= 20)
        });
        scan.kill().expect("it runs");
        scan.wait().expect("it ends");
        let next = run(arguments);
        assert_eq!(next.status.code(), Some(0), "{name} {number}: {}", stderr(&next));
    }
    let (_, printed) = mock.stop();
    assert!(!printed.contains("coils released"), "no lease had to end: {printed}");
}

#[test]
fn full_disk() {
    let folder = tempfile::tempdir().expect("a folder");
    // A limit on the file's size fails writes as a full disk does, and needs no disk.
    let limited = "ulimit -f 100; trap '' XFSZ; exec \"$0\" \"$@\"";
    let output = std::process::Command::new("sh")
        .args(["-c", limited, env!("CARGO_BIN_EXE_sonard"), "scan", "--mock"])
        .args(["--scene", "simple-room", "--pose", "fig9", "--out"])
        .arg(folder.path())
        .env("NO_COLOR", "1")
        .output()
        .expect("starts");
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("file-size limit"), "{}", stderr(&output));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    let logged = log.pings().len();
    assert!((20..400).contains(&logged), "{logged} readings");
    // The end itself may not have found room.
    for end in log.of_type("scan_end") {
        assert_eq!(end["beams"], logged);
        assert_eq!(end["missing"], 400 - logged);
    }
}

#[test]
fn restart_while_homing() {
    let folder = tempfile::tempdir().expect("a folder");
    // One beam at home: the motor only ever goes home, before and after.
    let further =
        ["--to-deg", "0.9", "--repeat", "20", "--faults", "motor_reset=0.1", "--seed", "3"];
    let output = mock_scan("fig9", folder.path(), &further);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains("homing after the scan failed"), "{}", stderr(&output));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    assert_eq!(log.of_type("scan_end").filter(|end| end["beams"] == 1).count(), 20);
}

#[test]
fn impossible_readings() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = mock_scan("fig9", folder.path(), &["--faults", "lie=late-echo"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    log.assert_each_beam_once(400);
    let lost: Vec<_> =
        log.pings().into_iter().filter(|ping| ping["status"] == "link_lost").collect();
    assert_eq!(lost.len(), 4, "beams 7, 107, 207 and 307");
    assert!(lost.iter().all(|ping| ping["index"].as_u64().is_some_and(|index| index % 100 == 7)));
    assert_eq!((&log.end()["missing"], &log.end()["beams"]), (&4.into(), &396.into()));
    let reported = log.events().iter().filter(|event| event.contains("echo after")).count();
    assert_eq!(reported, 4, "{:?}", log.events());
}

#[test]
fn other_board_ends_the_session() {
    let folder = tempfile::tempdir().expect("a folder");
    let further = ["--faults", "reset=0.02,lie=other-steps", "--seed", "2"];
    let output = mock_scan("fig9", folder.path(), &further);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    // Joined, without the line breaks of a terminal.
    let printed = stderr(&output).replace('│', " ");
    let printed = printed.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(printed.contains("800 steps per revolution, not 400"), "{printed}");
    let log = Log::read(&folder.path().join("scan.jsonl"));
    log.assert_each_beam_once(400);
    assert!(log.end()["missing"].as_u64() > Some(0));
}
