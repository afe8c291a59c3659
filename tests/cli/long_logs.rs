//! Peak memory of verbs on a log of days, which they read scan by scan.

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

/// A simulated scan with its predicted paths, repeated under other ids.
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
#[ignore = "prints figures"]
fn figures_of_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let [log, picture, map, trusted] = ["long.jsonl", "all.svg", "map", "trusted.jsonl"].map(path);
    let [table, typed, recording] = ["all.csv", "all.parquet", "all.mcap"].map(path);
    write_log(log.as_ref(), folder.path());
    let size_mb = fs::metadata(&log).expect("is there").len() >> 20;
    for arguments in [
        &["log", "show", &log][..],
        &["log", "verify", &log],
        &["log", "annotate", &log, "-o", &trusted],
        &["compare", &log],
        &["export", &log, "-o", &table],
        &["export", &log, "-o", &typed],
        &["export", &log, "-o", &recording],
        &["compare", "--scene", "simple-room", &log],
        &["map", &log, "--out", &map],
        &["plot", &log, "-o", &picture],
    ] {
        let peak_mb = peak_mb(arguments);
        println!("{peak_mb} MB of a log of {size_mb} MB: {arguments:?}");
    }
}
