//! Files of other kinds in place of a log: a short message with advice.

use std::{fs, process::Stdio};

use crate::{
    collect::joined_stderr,
    common::{run, sonard, stderr},
};

const LOG: &str = include_str!("../fixtures/small.jsonl");

/// Files that are no logs: name, content, and the expected part of the message.
fn others() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let mut junk = Vec::new();
    let mut state = 7_u32;
    for _ in 0..300_000 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        junk.push((state >> 24) as u8);
    }
    vec![
        ("log.jsonl.gz", b"\x1f\x8b\x08\0\0\0\0\0\0\x03abc".to_vec(), "gzip"),
        ("log.zip", b"PK\x03\x04\x14\0\0".to_vec(), "compressed"),
        ("a.png", include_bytes!("../../docs/pictures/simple-room-fig9.png").to_vec(), "PNG"),
        ("a.svg", include_bytes!("../../docs/wiring/wiring.svg").to_vec(), "SVG"),
        ("a.mcap", b"\x89MCAP0\r\n\x01\0\0".to_vec(), "MCAP"),
        ("a.parquet", b"PAR1\x15\x04\x15\x10".to_vec(), "Parquet"),
        ("a.bag", b"#ROSBAG V2.0\nE\0\0\0".to_vec(), "ROS bag"),
        ("a.db3", b"SQLite format 3\0\x10\0\x01".to_vec(), "SQLite"),
        ("poses.csv", b"x,y,deg\n1,2,3\n4,5,6\n".to_vec(), "comma"),
        ("room.json", include_bytes!("../../scenes/mcgill-lab.json").to_vec(), "--scene"),
        ("s.json", include_bytes!("../../sensors/senscomp-6500.json").to_vec(), "--sensor"),
        ("a.json", include_bytes!("../../arrays/ring-12.json").to_vec(), "--array"),
        ("sonard.toml", include_bytes!("../../config/sonard.toml").to_vec(), "TOML"),
        ("empty.jsonl", Vec::new(), "empty"),
        ("junk", junk, "binary"),
        ("notes.txt", b"Dear diary,\nnothing today.\n".repeat(5000), "text"),
    ]
}

#[test]
fn other_kinds_of_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (svg, map) = (path("out.svg"), path("map"));
    for (name, content, has_text) in others() {
        fs::write(path(name), &content).expect("writable");
        let file = path(name);
        for arguments in [
            vec!["compare", &file],
            vec!["plot", &file, "-o", &svg],
            vec!["interpret", &file],
            vec!["lines", &file],
            vec!["map", &file, "--out", &map],
            vec!["log", "annotate", &file],
        ] {
            let output = run(&arguments);
            let message = stderr(&output);
            assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
            assert!(joined_stderr(&output).contains(has_text), "{arguments:?}: {message}");
            assert!(message.lines().count() <= 16, "{arguments:?}: {message}");
        }
        // These look at any text, but not without end.
        for verb in ["show", "verify"] {
            let output = run(&["log", verb, &file]);
            let lines = output.stdout.iter().filter(|byte| **byte == b'\n').count();
            assert!(lines <= 10, "log {verb} {file}: {lines} lines");
        }
        if name != "empty.jsonl" {
            let output = run(&["log", "repair", &file]);
            assert_eq!(output.status.code(), Some(2), "{name}: {}", stderr(&output));
        }
        assert_eq!(fs::read(path(name)).expect("kept"), content, "{name}");
        let piped = sonard(&["compare", "-"]).stdin(fs::File::open(&file).expect("there")).output();
        let output = piped.expect("starts");
        assert_eq!(output.status.code(), Some(2), "{name}: {}", stderr(&output));
        assert!(joined_stderr(&output).contains(has_text), "{name}: {}", stderr(&output));
    }
    let output = run(&["plot", folder.path().to_str().expect("plain path")]);
    assert!(joined_stderr(&output).contains("directory"), "{}", stderr(&output));
}

#[test]
fn damaged_lines_are_limited() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log.jsonl");
    fs::write(&log, LOG.to_owned() + &"not a record\n".repeat(11_640)).expect("writable");
    let log = log.to_str().expect("plain path");
    for arguments in [&["compare", log][..], &["lines", log], &["log", "annotate", log]] {
        let message = stderr(&run(arguments));
        assert_eq!(message.matches("line skipped").count(), 5, "{arguments:?}: {message}");
        assert!(message.contains("11,635 more damaged lines"), "{arguments:?}: {message}");
    }
    for verb in ["show", "verify"] {
        let text = String::from_utf8(run(&["log", verb, log]).stdout).expect("text");
        assert!(text.contains("11,635 more"), "{text}");
    }
}

#[test]
fn unreadable_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("no-such.jsonl").display().to_string();
    for arguments in
        [&["compare", &log][..], &["log", "show", &log], &["plot", &log, "-o", "x.svg"]]
    {
        let output = sonard(arguments).stdout(Stdio::null()).output().expect("starts");
        let message = joined_stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains("cannot open") && !message.contains("write"), "{message}");
    }
}
