//! Steps of the computer's wall clock while the daemon runs. `libfaketime` is loaded between it and the
//! clock; without that library, `FAKETIME=0` leaves the test out.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use jiff::Timestamp;

use super::{Daemon, clean_log};
use crate::common::{Log, sonard, wait_until};

/// Path of the library in Debian, for any architecture.
fn library() -> PathBuf {
    let folders = fs::read_dir("/usr/lib").expect("a folder").flatten();
    let mut places = folders.map(|folder| folder.path().join("faketime/libfaketime.so.1"));
    places.find(|place| place.exists()).expect(
        "libfaketime is missing: sudo apt-get install libfaketime, or leave this out by FAKETIME=0",
    )
}

/// Program whose clock has the offset in a file.
fn with_clock(arguments: &[&str], offset: &Path) -> Command {
    fs::write(offset, "+0").expect("writable");
    let mut command = sonard(arguments);
    command
        .env("LD_PRELOAD", library())
        .env("FAKETIME_TIMESTAMP_FILE", offset)
        .env("FAKETIME_NO_CACHE", "1")
        // The clock that never jumps doesn't.
        .env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
    command
}

fn is_left_out() -> bool {
    let left_out = env::var("FAKETIME").is_ok_and(|wanted| wanted == "0");
    if left_out {
        eprintln!("LEFT OUT, because FAKETIME=0");
    }
    left_out
}

#[test]
fn clock_step_within_a_scan() {
    if is_left_out() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (offset, out) = (folder.path().join("offset"), folder.path().join("out"));
    let scan = ["scan", "--mock", "--scene", "simple-room", "--pose", "fig9", "--max-range", "4"];
    let mut scanning = with_clock(&scan, &offset)
        .args(["--realtime", "--to-deg", "90", "--repeat", "2", "--out"])
        .arg(&out)
        .stderr(Stdio::null())
        .spawn()
        .expect("starts");
    let log = out.join("scan.jsonl");
    wait_until("some readings", || {
        fs::read_to_string(&log).is_ok_and(|log| log.matches("\"ping\"").count() >= 20)
    });
    fs::write(&offset, "+3600").expect("writable");
    assert_eq!(scanning.wait().expect("it ends").code(), Some(0));
    let log = Log::read(&log);
    let steps: Vec<_> =
        log.events().into_iter().filter(|event| event.contains("clock_step")).collect();
    assert!(steps.len() == 1 && steps[0].contains("+3600.0"), "{steps:?}");
    let step = log.records.iter().position(|record| record["kind"] == "clock_step");
    let end = log.records.iter().position(|record| record["type"] == "scan_end");
    assert!(step < end, "logged within the scan of the step");
    let mut times: Vec<Timestamp> = log.pings()[..100]
        .iter()
        .map(|ping| ping["time"].as_str().expect("a time").parse().expect("a time"))
        .collect();
    times.sort();
    assert!(times[99].duration_since(times[0]).as_secs() < 60, "{} to {}", times[0], times[99]);
    let second = log.of_type("scan_start").nth(1).expect("a second scan")["time"].clone();
    let second: Timestamp = second.as_str().expect("a time").parse().expect("a time");
    assert!(second.duration_since(times[99]).as_secs() > 3000, "the next one has the new clock");
}

#[test]
fn clock_step_loses_no_beam() {
    if is_left_out() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let offset = folder.path().join("offset");
    let command = with_clock(&[], &offset);
    let mock = ["--mock", "--scene", "simple-room", "--pose", "fig9"];
    let short = ["plan.to_deg=36", "plan.step_deg=3.6", "model.max_range_m=1"];
    let settings = ["scanning.mode=continuous"].into_iter().chain(short);
    let settings: Vec<_> = settings.flat_map(|setting| ["--set", setting]).collect();
    let daemon = Daemon::start_as(command, folder.path(), &[&mock[..], &settings].concat());
    daemon.wait_for_scans(2);
    for (steps, offset_s) in [(1, "+3600"), (2, "-3600")] {
        fs::write(&offset, offset_s).expect("writable");
        wait_until("the note", || daemon.health()["clock"]["steps"] == steps);
        let before = daemon.health()["scans"]["completed"].as_u64().expect("a count");
        daemon.wait_for_scans(before + 2);
    }
    assert_eq!(daemon.health()["scans"]["failed"], 0);
    assert_eq!(daemon.stop(), Some(0));
    let log = clean_log(folder.path());
    let steps: Vec<_> =
        log.events().into_iter().filter(|event| event.contains("clock_step")).collect();
    assert!(
        steps.len() == 2 && steps[0].contains("+3600.0") && steps[1].contains("-7200.0"),
        "{steps:?}"
    );
    for end in log.of_type("scan_end") {
        let beams = log.pings().iter().filter(|ping| ping["scan"] == end["scan"]).count() as u64;
        assert_eq!(beams, end["beams"].as_u64().expect("a count"), "{end}");
    }
}

#[test]
fn ages_ignore_clock_steps() {
    if is_left_out() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let offset = folder.path().join("offset");
    let command = with_clock(&[], &offset);
    let mock = ["--mock", "--scene", "simple-room", "--pose", "fig9"];
    let short = ["plan.to_deg=36", "plan.step_deg=3.6", "model.max_range_m=1"];
    let settings =
        ["scanning.mode=continuous", "server.listen=127.0.0.1:0"].into_iter().chain(short);
    let settings: Vec<_> = settings.flat_map(|setting| ["--set", setting]).collect();
    let daemon = Daemon::start_as(command, folder.path(), &[&mock[..], &settings].concat());
    daemon.wait_for_scans(2);
    let socket = folder.path().join("s").display().to_string();
    for offset_s in ["+1800000000", "-100000", "+0", "+0.3"] {
        fs::write(&offset, offset_s).expect("writable");
        // Within a scan, between two, and after.
        for _ in 0..8 {
            let health = daemon.health();
            let link = daemon.status()["link"].clone();
            let figures = String::from_utf8(daemon.get("/metrics").body).expect("text");
            for (name, age_s) in [
                ("last scan", &health["last_scan_age_s"]),
                ("lateness", &health["reading_lateness_s"]),
                ("state", &link["for_s"]),
            ] {
                let age_s = age_s.as_f64().unwrap_or_else(|| panic!("{name}: {health} {link}"));
                assert!((-0.2..20.0).contains(&age_s), "{offset_s}, {name}: {age_s}");
            }
            for figure in ["sonard_last_scan_age_seconds ", "sonard_reading_lateness_seconds "] {
                let line =
                    figures.lines().find(|line| line.starts_with(figure)).expect("the metric");
                let value: f64 = line[figure.len()..].parse().expect("a number");
                assert!((-0.2..20.0).contains(&value), "{offset_s}, {line}");
            }
            let output = sonard(&["status", "--socket", &socket]).output().expect("it starts");
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            let seconds = text.split(" for ").nth(1).and_then(|rest| rest.split(' ').next());
            let seconds: f64 =
                seconds.and_then(|s| s.parse().ok()).unwrap_or_else(|| panic!("{text}"));
            assert!((0.0..20.0).contains(&seconds), "{offset_s}: {text}");
        }
    }
    assert_eq!(daemon.health()["scans"]["failed"], 0);
}
