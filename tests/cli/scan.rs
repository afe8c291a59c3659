//! A scan from end to end: bytes over a pty, a log, a comparison, a picture.

use std::fs;

use crate::common::{Log, met, mock_scan, run, sonard, stderr};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn false_wall_of_figure_9() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = mock_scan("fig9", folder.path(), &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    log.assert_each_beam_once(400);
    let near_270 =
        log.pings().into_iter().filter(|p| (number(&p["azimuth_deg"]) - 270.0).abs() < 5.0);
    let mut seen = 0;
    for ping in near_270 {
        assert_eq!(ping["status"], "echo", "{ping}");
        // The wall is 85 mm away; the echo comes from near, far and near wall again.
        assert!((number(&ping["range_m"]) - 0.827).abs() < 0.010, "{ping}");
        assert_eq!(met(&ping["sim"]["path"]), ["south", "north", "south"]);
        seen += 1;
    }
    assert_eq!(seen, 11);
    let end = log.end();
    assert_eq!((&end["beams"], &end["missing"]), (&400.into(), &0.into()));
    let svg = fs::read_to_string(folder.path().join("scan.svg")).expect("a picture");
    assert!(svg.contains("simple-room"));
    assert!(fs::read(folder.path().join("scan.png")).expect("a picture").starts_with(b"\x89PNG"));
}

#[test]
fn minimum_range() {
    let folder = tempfile::tempdir().expect("a folder");
    assert_eq!(mock_scan("fig7", folder.path(), &[]).status.code(), Some(0));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    let near: Vec<_> = log.pings().into_iter().filter(|p| p["status"] == "min_range").collect();
    assert!(near.len() >= 10, "{} readings at the minimum range", near.len());
    for ping in near {
        // 2.38 ms of blanking at 343.99 m/s, and the 20 us that still count as its end.
        assert!((0.409..0.413).contains(&number(&ping["range_m"])), "{ping}");
    }
}

#[test]
fn mock_provenance() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = crate::common::MockProcess::start(folder.path(), &[]);
    let port = mock.port().to_owned();
    let output = run(&["scan", "--port", &port, "--scene", "simple-room", "--pose", "fig9"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let log = Log::parse(&String::from_utf8(output.stdout).expect("text"));
    let session = log.of_type("session").next().expect("a session");
    assert_eq!(session["provenance"], "mock");
    assert_eq!(session["device"]["tick_hz"], 2_000_000);
    log.assert_each_beam_once(400);
    let (code, printed) = mock.stop();
    assert_eq!(code, Some(0));
    assert!(printed.contains("400 firings") && printed.contains("stopped"), "{printed}");
    assert!(!folder.path().join("ranger").exists(), "the link goes with the mock");
}

#[test]
fn pipe_into_compare() {
    let scan = run(&[
        "scan",
        "--mock",
        "--scene",
        "simple-room",
        "--pose",
        "fig9",
        "--from-deg",
        "-45",
        "--to-deg",
        "45",
        "--pings-per-stop",
        "2",
        "--repeat",
        "2",
        "--max-range",
        "4",
    ]);
    assert_eq!(scan.status.code(), Some(0), "{}", stderr(&scan));
    let log = Log::parse(std::str::from_utf8(&scan.stdout).expect("text"));
    assert_eq!(log.of_type("scan_start").count(), 2);
    assert_eq!(log.pings().len(), 400);
    let first = log.pings()[0];
    assert_eq!((&first["azimuth_deg"], &first["step"]), (&315.0.into(), &(-50).into()));

    let mut compare = sonard(&["compare", "-", "--json"]);
    compare.stdin(std::process::Stdio::piped()).stdout(std::process::Stdio::piped());
    let mut compare = compare.spawn().expect("starts");
    std::io::Write::write_all(&mut compare.stdin.take().expect("piped"), &scan.stdout)
        .expect("it reads");
    let output = compare.wait_with_output().expect("ends");
    let comparison: Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(comparison["beams"], 400);
    assert!(number(&comparison["agree_fraction"]) > 0.99, "{comparison}");
}

#[test]
fn temperature_bias() {
    let folder = tempfile::tempdir().expect("a folder");
    let further = ["--truth-temperature-c", "25", "--noise-mm", "0"];
    assert_eq!(mock_scan("fig9", folder.path(), &further).status.code(), Some(0));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    let ratios: Vec<f64> = log
        .pings()
        .iter()
        .filter(|ping| ping["status"] == "echo" && ping["sim"]["status"] == "echo")
        .map(|ping| number(&ping["range_m"]) / number(&ping["sim"]["range_m"]))
        .collect();
    // Sound is faster by 0.6 m/s a degree, so echoes come early by 0.9 %.
    let right = ratios.iter().filter(|&&ratio| (ratio - 0.9912).abs() < 0.002).count();
    assert!(right * 10 > ratios.len() * 9, "{right} of {}", ratios.len());
}

#[test]
fn missed_steps_found_by_homing() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = mock_scan("fig9", folder.path(), &["--missed-steps", "0.02", "--max-range", "3"]);
    assert_eq!(output.status.code(), Some(0));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    let drift = log.end()["home_drift_steps"].as_i64().expect("a drift");
    // Some 8 of 399 moves fall a step short.
    assert!((2..=20).contains(&drift), "{drift}");
    assert!(log.events().iter().any(|event| event.contains("azimuths are uncertain")));
    assert!(stderr(&output).contains("warning"), "{}", stderr(&output));
}

#[test]
fn second_run_appends() {
    let folder = tempfile::tempdir().expect("a folder");
    let few = ["--to-deg", "9"];
    assert_eq!(mock_scan("fig9", folder.path(), &few).status.code(), Some(0));
    let before = fs::read(folder.path().join("scan.jsonl")).expect("a log");
    assert_eq!(mock_scan("fig9", folder.path(), &few).status.code(), Some(0));
    let after = fs::read(folder.path().join("scan.jsonl")).expect("a log");
    assert!(after.starts_with(&before) && after.len() > before.len());
    assert_eq!(Log::read(&folder.path().join("scan.jsonl")).of_type("session").count(), 2);
}

#[test]
fn real_time_duration() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = mock_scan("fig9", folder.path(), &["--realtime", "--max-range", "4"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let log = Log::read(&folder.path().join("scan.jsonl"));
    let end = log.end();
    let ratio = number(&end["duration_s"]) / number(&end["acoustic_limit_s"]);
    assert!((1.0..1.02).contains(&ratio), "{ratio}");
    // Wall-clock times of the readings follow the device's clock.
    let pings = log.pings();
    let time = |ping: &Value| -> jiff::Timestamp {
        ping["time"].as_str().expect("a time").parse().expect("RFC 3339")
    };
    let wall_s = time(pings[399]).duration_since(time(pings[0])).as_secs_f64();
    let ticks = number(&pings[399]["fired_ticks"]) - number(&pings[0]["fired_ticks"]);
    assert!((wall_s - ticks / 2e6).abs() < 0.02, "{wall_s} s for {ticks} ticks");
    assert!(number(&pings[200]["time_sigma_us"]) < 20_000.0);
}

#[test]
fn link_statistics_per_scan() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("plain path");
    let scan = ["scan", "--mock", "--scene", "simple-room", "--pose", "fig9", "--max-range", "2"];
    let output = run(&[&scan[..], &["--to-deg", "90", "--repeat", "3", "--out", out]].concat());
    let text = stderr(&output);
    let received: Vec<f64> = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("link: ")?.split(' ').next())
        .filter_map(|bytes| bytes.replace(',', "").parse().ok())
        .collect();
    let [first, second, third, all] = received[..] else { panic!("{text}") };
    assert!((first + second + third - all).abs() < 0.5, "{text}");
    assert!(third < 1.5 * first && second > 0.5 * first, "{text}");
    assert!(text.contains("total 3 scans"), "{text}");
}
