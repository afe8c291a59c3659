//! What verbs take in memory does not grow with a log: a log of days is read scan by scan.

use std::{
    fs::{self, File},
    io::{BufWriter, Write as _},
    path::Path,
    process::Stdio,
    time::Duration,
};

use crate::common::{run, sonard, stderr};

/// Scans of 400 beams in the log.
const SCANS: usize = 700;
/// What a verb may have in memory at most, megabytes.
const MOST_MB: u64 = 64;
/// The same of pictures, which keep up to 60,000 readings.
const MOST_DRAWN_MB: u64 = 180;

/// One simulated scan with its predictions' paths, again and again under other ids.
fn write_log(path: &Path, folder: &Path) {
    let one = folder.join("one.jsonl");
    let one = one.to_str().expect("a plain path");
    let made = run(&["simulate", "--scene", "simple-room", "--pose", "fig7", "-o", one]);
    assert!(made.status.success(), "{}", stderr(&made));
    let text = fs::read_to_string(one).expect("a log");
    let (session, scan) = text.split_once('\n').expect("lines");
    let start: serde_json::Value =
        serde_json::from_str(scan.lines().next().expect("a line")).expect("JSON");
    let id = start["scan"].as_str().expect("an id");
    let mut log = BufWriter::new(File::create(path).expect("creates"));
    writeln!(log, "{session}").expect("writes");
    for number in 0..SCANS {
        let other = format!("{number:08x}{}", &id[8..]);
        log.write_all(scan.replace(id, &other).as_bytes()).expect("writes");
    }
    log.flush().expect("writes");
}

/// Runs a verb to its end; the most memory that it had, megabytes.
fn peak_mb(arguments: &[&str]) -> u64 {
    let mut child =
        sonard(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts");
    let mut peak_kb = 0;
    let code = loop {
        if let Some(code) = child.try_wait().expect("ours") {
            break code;
        }
        // Empty once it has ended.
        let status = fs::read_to_string(format!("/proc/{}/status", child.id()));
        let line = status.unwrap_or_default();
        let line = line.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let now_kb = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse().ok());
        peak_kb = peak_kb.max(now_kb.unwrap_or(0));
        std::thread::sleep(Duration::from_millis(2));
    };
    assert!(code.success(), "{arguments:?}: {code}");
    peak_kb / 1024
}

#[test]
fn verbs_read_a_long_log_in_little_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let [log, picture, map, trusted] = ["long.jsonl", "all.svg", "map", "trusted.jsonl"].map(path);
    let [table, typed, recording] = ["all.csv", "all.parquet", "all.mcap"].map(path);
    write_log(log.as_ref(), folder.path());
    let size_mb = fs::metadata(&log).expect("is there").len() >> 20;
    assert!(size_mb > MOST_MB, "{size_mb} MB tell nothing");
    for (arguments, most_mb) in [
        (&["log", "show", &log][..], MOST_MB),
        (&["log", "verify", &log], MOST_MB),
        (&["log", "annotate", &log, "-o", &trusted], MOST_MB),
        (&["compare", &log], MOST_MB),
        (&["export", &log, "-o", &table], MOST_MB),
        (&["export", &log, "-o", &typed], MOST_MB),
        (&["export", &log, "-o", &recording], MOST_MB),
        (&["compare", "--scene", "simple-room", &log], MOST_MB),
        (&["map", &log, "--out", &map], MOST_MB),
        (&["plot", &log, "-o", &picture], MOST_DRAWN_MB),
    ] {
        let peak_mb = peak_mb(arguments);
        println!("{peak_mb} MB of {most_mb}: {arguments:?}");
        assert!(peak_mb <= most_mb, "{peak_mb} MB: {arguments:?}");
    }
}
