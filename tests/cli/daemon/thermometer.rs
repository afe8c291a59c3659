//! Values that a thermometer or the air cannot have.

use std::{fs, path::Path};

use serde_json::Value;
use sonard_test_support::in_process::Daemon;

/// A scratchpad of zeros, the checksum of which is right.
const ZEROS: &str = "00 00 00 00 00 00 00 00 00 : crc=00 YES\n00 00 00 00 00 00 00 00 00 t=0\n";
/// A measured 0 C.
const ZERO_C: &str = "00 00 4b 46 7f ff 10 10 69 : crc=69 YES\n00 00 4b 46 7f ff 10 10 69 t=0\n";

/// Starts a daemon with a thermometer's file that is read each second.
fn start(folder: &Path, file: &Path) -> Daemon {
    let file = format!("air.file={}", file.display());
    Daemon::start_mock(folder, &["--set", &file, "--set", "air.every_s=1"])
}

fn reasons(daemon: &Daemon) -> String {
    daemon.health()["reasons"].to_string()
}

fn air(daemon: &Daemon) -> Value {
    daemon.status()["air"].clone()
}

#[test]
fn zeros() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("w1_slave");
    fs::write(&file, ZEROS).expect("a file");
    let daemon = start(folder.path(), &file);
    daemon.wait_until("the report", || {
        reasons(&daemon).contains("all registers of the sensor are 00")
    });
    let now = air(&daemon);
    assert_eq!((&now["temperature_c"], &now["source"]), (&20.0.into(), &"configuration".into()));
    daemon.wait_until("the message", || {
        daemon.messages().contains("all registers of the sensor are 00")
    });

    fs::write(&file, ZERO_C).expect("a file");
    daemon.wait_until("0 C", || air(&daemon)["temperature_c"] == 0.0);
    let now = air(&daemon);
    assert_eq!((&now["source"], &now["error"]), (&"file".into(), &Value::Null));
    assert!(!reasons(&daemon).contains("thermometer"), "{}", reasons(&daemon));
    assert_eq!(
        daemon.messages().matches("WARN the thermometer").count(),
        1,
        "{}",
        daemon.messages()
    );
}

#[test]
fn last_valid_temperature() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("temp1_input");
    fs::write(&file, "21500\n").expect("a file");
    let daemon = start(folder.path(), &file);
    daemon.wait_until("21.5 C", || air(&daemon)["temperature_c"] == 21.5);
    let mut replaced_by_pipe = false;
    for (bad, part) in [
        (Some("1500\n"), "air does not change so fast"),
        (Some(ZERO_C), "air does not change so fast"),
        (Some(ZEROS), "all registers"),
        (Some("85000\n"), "before its first conversion"),
        (Some(""), "it is empty"),
        (Some("nan\n"), "not a number"),
        (None, "a named pipe"),
    ] {
        match bad {
            Some(bad) => fs::write(&file, bad).expect("a file"),
            None => {
                fs::remove_file(&file).expect("removed");
                let made = std::process::Command::new("mkfifo").arg(&file).status();
                replaced_by_pipe = made.expect("mkfifo").success();
            }
        }
        daemon.wait_until(part, || reasons(&daemon).contains(part));
        let reasons = reasons(&daemon);
        assert!(reasons.contains("the last valid temperature, 21.5 C, is"), "{reasons}");
        assert_eq!(air(&daemon)["temperature_c"], 21.5);
    }
    assert!(replaced_by_pipe);
    let age_s = air(&daemon)["age_s"].as_f64().expect("an age");
    assert!(age_s > 3.0, "{age_s}");
    let figures = String::from_utf8(daemon.get("/metrics").body).expect("text");
    assert!(figures.contains("sonard_thermometer_failing 1"), "{figures}");
    assert!(figures.contains("sonard_air_temperature_celsius 21.5"), "{figures}");
    assert!(figures.contains("sonard_air_age_seconds "), "{figures}");
    let text = String::from_utf8(daemon.run_client("status").stdout).expect("text");
    assert!(text.contains("21.5 C (file, ") && text.contains("a named pipe"), "{text}");

    // It is no longer blocked, whatever the pipe did.
    fs::remove_file(&file).expect("removed");
    fs::write(&file, "22000\n").expect("a file");
    daemon.wait_until("22 C", || air(&daemon)["temperature_c"] == 22.0);
    assert_eq!(reasons(&daemon), "[]");
}

#[test]
fn slow_changes() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("temp1_input");
    fs::write(&file, "21000\n").expect("a file");
    let daemon = start(folder.path(), &file);
    for thousandths in (21_000..24_000).step_by(500) {
        fs::write(&file, format!("{thousandths}\n")).expect("a file");
        let expected = f64::from(thousandths) / 1e3;
        daemon.wait_until("the change", || air(&daemon)["temperature_c"] == expected);
    }
    assert!(!daemon.messages().contains("WARN"), "{}", daemon.messages());
}

#[test]
fn blocking_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&file).status().expect("mkfifo").success());
    let daemon = start(folder.path(), &file);
    daemon.wait_until("the report", || reasons(&daemon).contains("a named pipe"));
    daemon.stop();
}
