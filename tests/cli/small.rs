//! Small things that once misled: each stands for its kind.

use std::{ffi::OsStr, fs, os::unix::ffi::OsStrExt as _};

use crate::{
    collect::{Case, said},
    common::{run, sonard, stderr},
};

#[test]
fn a_window_that_ends_before_the_receiver_opens_is_refused_with_the_least() {
    let scan = ["scan", "--mock", "--scene", "simple-room", "--pose", "fig9"];
    for short in [["--window-ms", "1"], ["--max-range", "0.3"], ["--window-ms", "2.38"]] {
        let output = run(&[&scan[..], &short].concat());
        let text = said(&output);
        assert_eq!(output.status.code(), Some(2), "{short:?}: {text}");
        assert!(text.contains("no echo could be detected"), "{text}");
        assert!(text.contains("more than 2.38 ms") && text.contains("0.41 m"), "{text}");
    }
    let longer = run(&[&scan[..], &["--window-ms", "2.5", "--to-deg", "9"]].concat());
    assert_eq!(longer.status.code(), Some(0), "{}", stderr(&longer));
    let case = Case::new("[poses]\nlist = [\"fig9\"]\n[motion]\nwindow_ms = 1\n");
    let text = said(&case.collect(&[]));
    assert!(text.contains("no echo could be detected"), "{text}");
    let daemon = ["run", "--check", "--mock", "--scene", "simple-room", "--pose", "fig9"];
    let output = run(&[&daemon[..], &["--set", "motion.window_ms=1"]].concat());
    let text = said(&output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("motion.window_ms") && text.contains("no echo could be detected"), "{text}");
}

#[test]
fn the_line_is_counted_for_each_scan_and_in_all() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("plain path");
    let scan = ["scan", "--mock", "--scene", "simple-room", "--pose", "fig9", "--max-range", "2"];
    let output = run(&[&scan[..], &["--to-deg", "90", "--repeat", "3", "--out", out]].concat());
    let text = stderr(&output);
    let received: Vec<f64> = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("link: ")?.split(' ').next()?.parse().ok())
        .collect();
    let [first, second, third, all] = received[..] else { panic!("{text}") };
    assert!((first + second + third - all).abs() < 0.5, "{text}");
    assert!(third < 1.5 * first && second > 0.5 * first, "{text}");
    assert!(text.contains("3 scans in all"), "{text}");
}

#[test]
fn what_comes_with_the_program_is_listed_and_printed() {
    let folder = tempfile::tempdir().expect("a folder");
    for (kind, name, use_it) in [
        (
            "sensor",
            "hc-sr04",
            &["simulate", "--scene", "simple-room", "--pose", "fig9", "--sensor"][..],
        ),
        ("array", "ring-12", &["simulate", "--scene", "mcgill-lab", "--pose", "fig4", "--array"]),
        ("scene", "corridor", &["scene", "check"]),
    ] {
        let listed = run(&[kind, "list"]);
        assert!(String::from_utf8_lossy(&listed.stdout).contains(name), "{kind}");
        let shown = run(&[kind, "show", name]);
        assert_eq!(shown.status.code(), Some(0), "{}", stderr(&shown));
        // What is printed is a file that does what the name does.
        let path = folder.path().join(format!("{kind}.json"));
        fs::write(&path, &shown.stdout).expect("writes");
        let path = path.to_str().expect("plain path");
        let short: &[&str] = if kind == "sensor" { &["--to-deg", "9"] } else { &[] };
        let used = run(&[use_it, &[path], short].concat());
        assert_eq!(used.status.code(), Some(0), "{kind}: {}", stderr(&used));
        let unknown = run(&[kind, "show", "no-such-one"]);
        assert_eq!(unknown.status.code(), Some(2));
        assert!(said(&unknown).contains(name), "{}", said(&unknown));
    }
}

#[test]
fn a_path_that_is_no_text_is_a_path() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join(OsStr::from_bytes(b"room-\xff.json"));
    fs::write(&scene, include_str!("../../scenes/simple-room.json")).expect("writes");
    for arguments in [
        &["scene", "check"][..],
        &["simulate", "--pose", "fig9", "--to-deg", "9", "--scene"],
        &["scan", "--mock", "--pose", "fig9", "--to-deg", "9", "--scene"],
    ] {
        let output = sonard(arguments).arg(&scene).output().expect("starts");
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    }
    // A configuration is text: it is refused by name.
    for option in ["--scene", "--log"] {
        let output = sonard(&["run", "--check", "--mock", option]).arg(&scene).output();
        let output = output.expect("starts");
        assert_eq!(output.status.code(), Some(2));
        assert!(said(&output).contains(&format!("{option}: ")), "{}", said(&output));
    }
}

#[test]
fn numbers_without_sense_are_refused_in_words() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log.jsonl");
    let log = log.to_str().expect("plain path");
    let simulate = ["simulate", "--scene", "simple-room", "--pose", "fig9", "-o", log];
    assert_eq!(run(&simulate).status.code(), Some(0));
    for resolution in ["1e-12", "1e-200"] {
        let out = folder.path().join("map");
        let out = out.to_str().expect("plain path");
        let map = run(&["map", log, "--out", out, "--resolution", resolution]);
        let text = said(&map);
        assert_eq!(map.status.code(), Some(2), "{text}");
        assert!(text.contains("more than 10^12 cells are too many"), "{text}");
    }
}

#[test]
fn several_logs_are_compared_one_by_one_and_all_together() {
    let folder = tempfile::tempdir().expect("a folder");
    let logs = ["one", "two"].map(|name| {
        let out = folder.path().join(name);
        let taken = crate::common::mock_scan("fig9", &out, &["--to-deg", "9"]);
        assert_eq!(taken.status.code(), Some(0), "{}", stderr(&taken));
        out.join("scan.jsonl").to_str().expect("plain path").to_owned()
    });
    let compared = run(&["compare", &logs[0], &logs[1]]);
    let text = String::from_utf8_lossy(&compared.stdout);
    let (_, all) = text.split_once("all 2 logs\n").unwrap_or_else(|| panic!("{text}"));
    assert!(all.starts_with("20 beams compared, in 2 scan(s)"), "{text}");
    assert!(!String::from_utf8_lossy(&run(&["compare", &logs[0]]).stdout).contains("all 1"));
}
