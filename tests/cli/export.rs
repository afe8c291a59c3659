//! Logs for other tools, through the whole program.

use std::{
    fs,
    path::Path,
    process::{Output, Stdio},
};

use crate::common::{Log, run, sonard, stderr};

const SMALL: &str = include_str!("../fixtures/small.jsonl");

/// A log of one simulated scan.
fn simulated(folder: &Path, name: &str, pose: &str) -> String {
    let log = folder.join(name).to_str().expect("a plain path").to_owned();
    let made = run(&["simulate", "--scene", "simple-room", "--pose", pose, "-o", &log]);
    assert!(made.status.success(), "{}", stderr(&made));
    log
}

fn printed(output: &Output) -> String {
    let printed = stderr(output);
    assert!(!printed.contains("panicked"), "{printed}");
    printed.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}

fn table_of(arguments: &[&str]) -> Vec<csv::StringRecord> {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    csv::Reader::from_reader(&*output.stdout).records().map(|row| row.expect("a row")).collect()
}

#[test]
fn one_row_per_reading() {
    let folder = tempfile::tempdir().expect("a folder");
    // As a collection leaves it: a journal that is no log, and scans.
    let scans = folder.path().join("scans");
    fs::create_dir(&scans).expect("writable");
    fs::write(folder.path().join("journal.jsonl"), "{\"kind\":\"started\"}\n").expect("writable");
    let first = simulated(&scans, "p001-r01.jsonl", "fig7");
    simulated(&scans, "p002-r01.jsonl", "fig9");
    let whole = folder.path().to_str().expect("a plain path");
    let rows = table_of(&["export", whole, "--to", "csv"]);
    assert_eq!(rows.len(), 800);
    assert_eq!((&rows[0][0], &rows[799][0]), ("p001-r01.jsonl", "p002-r01.jsonl"));
    // The folder of the scans, one log, and standard input.
    let in_scans = scans.to_str().expect("a plain path");
    assert_eq!(table_of(&["export", in_scans, "--to", "csv"]), rows);
    assert_eq!(table_of(&["export", &first, "--to", "csv"]), rows[..400]);
    let from_stdin = sonard(&["export", "-", "--to", "csv"])
        .stdin(fs::File::open(&first).expect("there"))
        .output()
        .expect("starts");
    let text = String::from_utf8(from_stdin.stdout).expect("text");
    assert_eq!(text.lines().count(), 401, "{}", String::from_utf8_lossy(&from_stdin.stderr));
    let ranges = Log::read(Path::new(&first));
    let received = ranges.pings().iter().filter(|ping| !ping["range_m"].is_null()).count();
    let at = text.lines().next().expect("names").split(',').position(|name| name == "range_m");
    let at = at.expect("a column");
    assert_eq!(rows[..400].iter().filter(|row| !row[at].is_empty()).count(), received);
}

#[test]
fn format_selection() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let log = path("small.jsonl");
    fs::write(&log, SMALL).expect("writable");
    for arguments in [&["export", &log][..], &["export", &log, "-o", &path("a.txt")]] {
        let refused = run(arguments);
        assert_eq!(refused.status.code(), Some(2), "{arguments:?}");
        assert!(
            printed(&refused).contains("--to mcap, --to parquet or --to csv"),
            "{}",
            printed(&refused)
        );
    }
    assert!(!folder.path().join("a.txt").exists());
    assert!(run(&["export", &log, "-o", &path("a.csv")]).status.success());
    // A table takes the place of such a table, and of nothing else.
    assert!(run(&["export", &log, "-o", &path("a.csv")]).status.success());
    fs::write(path("b.csv"), "azimuth_deg,range_m\n0,1\n").expect("writable");
    let refused = run(&["export", &log, "-o", &path("b.csv")]);
    assert!(printed(&refused).contains("comma-separated"), "{}", printed(&refused));
    assert_eq!(refused.status.code(), Some(2));
    for _ in 0..2 {
        assert!(run(&["export", &log, "-o", &path("a.parquet")]).status.success());
    }
    let to_pipe = run(&["export", &log, "--to", "parquet"]);
    assert_eq!(fs::read(path("a.parquet")).expect("written"), to_pipe.stdout);
    fs::write(path("b.parquet"), b"PAR1\x15\x04\x15").expect("writable");
    let refused = run(&["export", &log, "-o", &path("b.parquet")]);
    assert!(printed(&refused).contains("a table in Parquet"), "{}", printed(&refused));
    assert_eq!(refused.status.code(), Some(2));
}

#[test]
fn recording_with_attached_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let log = path("small.jsonl");
    fs::write(&log, SMALL).expect("writable");
    let record = |out: &str, further: &[&str]| {
        let out = path(out);
        run(&[&["export", &log, "-o", &out][..], further].concat())
    };
    for further in
        [&[][..], &["--profile", "nav2", "--frame", "front/sonar", "--field-of-view-deg", "15"]]
    {
        let output = record("a.mcap", further);
        assert!(output.status.success(), "{further:?}: {}", stderr(&output));
        let bytes = fs::read(path("a.mcap")).expect("written");
        assert!(bytes.windows(SMALL.len()).any(|piece| piece == SMALL.as_bytes()));
    }
    // Attachments are not compressed.
    let size = |further: &[&str]| {
        assert!(record("a.mcap", further).status.success());
        fs::metadata(path("a.mcap")).expect("written").len()
    };
    assert!(size(&[]) >= size(&["--without-log"]) + SMALL.len() as u64);
    // A recording of another program.
    fs::write(path("b.mcap"), b"\x89MCAP0\r\n\x01robot").expect("writable");
    assert_eq!(record("b.mcap", &[]).status.code(), Some(2));
    for (out, wrong) in [
        ("c.mcap", &["--frame", "/sonar"][..]),
        ("c.mcap", &["--field-of-view-deg", "0"]),
        ("c.mcap", &["--profile", "laser"]),
        ("c.csv", &["--profile", "nav2"]),
        ("c.csv", &["--without-log"]),
        ("c.parquet", &["--frame", "front"]),
    ] {
        let refused = record(out, wrong);
        assert_eq!(refused.status.code(), Some(2), "{wrong:?}: {}", printed(&refused));
        assert!(!Path::new(&path(out)).exists());
    }
}

#[test]
fn empty_folders_and_logs() {
    let folder = tempfile::tempdir().expect("a folder");
    let (empty, out) = (folder.path().to_str().expect("a plain path"), folder.path().join("a.csv"));
    let out = out.to_str().expect("a plain path");
    let refused = run(&["export", empty, "-o", out]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(printed(&refused).contains("no log in the folder"), "{}", printed(&refused));
    let log = folder.path().join("session.jsonl");
    fs::write(&log, SMALL.lines().next().expect("a session")).expect("writable");
    let refused = run(&["export", log.to_str().expect("a plain path"), "-o", out]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(printed(&refused).contains("there are no scans to export"), "{}", printed(&refused));
    assert!(!Path::new(out).exists());
}

#[test]
fn closed_reader() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = simulated(folder.path(), "a.jsonl", "fig7");
    let mut export = sonard(&["export", &log, &log, &log, "--to", "csv"]);
    let mut export = export.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    drop(export.stdout.take());
    let output = export.wait_with_output().expect("ends");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}
