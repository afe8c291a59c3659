//! Wrong input of `sonard scan` and `sonard simulate`: one clear message with advice, and the right exit code.

use std::{fs, io::Write as _, process::Stdio};

use crate::common::{mock_scan, run, sonard, stderr};

/// Runs `arguments` and checks the exit code and parts of the message.
#[track_caller]
pub(crate) fn check(arguments: &[&str], code: i32, parts: &[&str]) {
    let output = run(arguments);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    // Wrapped lines are one message.
    let message = message.replace(['\n', '│'], " ");
    let message = message.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in parts {
        assert!(message.contains(part), "{arguments:?}: {part:?} is not in: {message}");
    }
    assert!(!message.contains("panicked"), "{message}");
}

fn scan_of<'a>(scene: &'a str, pose: &'a str, further: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec!["scan", "--mock", "--scene", scene, "--pose", pose];
    arguments.extend(further);
    arguments
}

#[test]
fn option_of_another_engine() {
    let simulate = ["simulate", "--scene", "simple-room", "--pose", "fig9", "--to-deg", "9"];
    for (engine, option, knowing) in [
        ("cone", &["--lossless"][..], "--engine paths or --engine fan"),
        ("cone", &["--max-order", "2"], "--engine paths or --engine fan"),
        ("cone", &["--response", "full"], "--engine paths"),
        ("fan", &["--edge-law", "utd"], "--engine paths"),
        ("fan", &["--aperture-deg", "15"], "--engine cone"),
        ("fan", &["--ideal-receiver"], "--engine paths"),
        ("fan", &["--double-diffraction"], "--engine paths"),
        ("paths", &["--ray-spacing-deg", "0.1"], "--engine fan"),
        ("paths", &["--aperture-deg", "15"], "--engine cone"),
    ] {
        let wrong = [&simulate[..], &["--engine", engine], option].concat();
        check(&wrong, 2, &[option[0], &format!("not an option of the engine {engine}"), knowing]);
    }
}

#[test]
fn wrong_scenes_and_poses() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = |text: &str| {
        let path = folder.path().join("room.json");
        fs::write(&path, text).expect("writes");
        path.to_str().expect("plain path").to_owned()
    };
    let good = include_str!("../../scenes/simple-room.json");
    let unknown = scene(&good.replacen("\"reflectance\"", "\"reflectence\"", 1));
    check(&scan_of(&unknown, "fig9", &[]), 2, &["room.json", "reflectence", "reflectance"]);
    let last = good.rfind('}').expect("an object");
    let unclosed = scene(&good[..last]);
    check(&scan_of(&unclosed, "fig9", &[]), 2, &["room.json"]);
    check(&scan_of("no-such-room", "fig9", &[]), 2, &["no-such-room", "simple-room"]);
    check(&scan_of("simple-room", "fig8", &[]), 2, &["fig8", "fig7", "fig9"]);
    check(&scan_of("simple-room", "3,3,0", &[]), 2, &["outside"]);
    check(&scan_of("simple-room", "a,b", &[]), 2, &["X,Y,DEG"]);
}

#[test]
fn wrong_plans_and_settings() {
    let scan = |further: &[&'static str]| scan_of("simple-room", "fig9", further);
    check(&scan(&["--step-deg", "1"]), 2, &["step_deg 1", "0.9"]);
    check(&scan(&["--step-deg", "0"]), 2, &["step_deg"]);
    check(&scan(&["--to-deg", "-10"]), 2, &["to_deg"]);
    check(&scan(&["--pings-per-stop", "0"]), 2, &["pings_per_stop"]);
    check(&scan(&["--temperature-c", "900"]), 2, &["temperature"]);
    check(&scan(&["--sensor", "no-such"]), 2, &["senscomp-6500"]);
    check(&scan(&["--faults", "flop=1"]), 2, &["flop"]);
}

#[test]
fn unusable_output_folders() {
    let scan = |out| {
        [
            "scan",
            "--mock",
            "--scene",
            "simple-room",
            "--pose",
            "fig9",
            "--to-deg",
            "9",
            "--out",
            out,
        ]
    };
    check(&scan("/proc/sonard-out"), 2, &["/proc/sonard-out", "may write"]);
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    fs::write(&file, "data").expect("writes");
    check(&scan(file.to_str().expect("plain path")), 2, &["file"]);
    assert_eq!(fs::read(&file).expect("kept"), b"data");
}

#[test]
fn log_in_use() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("scan.jsonl");
    let _held = sonard::store::LogWriter::open(&log).expect("opens");
    let output = mock_scan("fig9", folder.path(), &["--to-deg", "9"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("another process"), "{}", stderr(&output));
}

#[test]
fn closed_reader() {
    let mut scan = sonard(&["scan", "--mock", "--scene", "simple-room", "--pose", "fig9"]);
    let mut child = scan.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("ends");
    assert!(!stderr(&output).contains("panicked"), "{}", stderr(&output));
    std::io::stdout().flush().expect("flushes");
}
