//! Collections that a running daemon takes.

use std::{path::Path, process::Stdio};

use serde_json::json;

use super::{Case, joined_stderr};
use crate::{
    common::{Log, interrupt, run, sonard, wait_until},
    daemon::{Daemon, clean_log},
};

/// A daemon that scans by itself, over a tenth of a turn.
fn daemon(folder: &Path, further: &[&str]) -> Daemon {
    let own = [
        "--set",
        "scanning.mode=continuous",
        "--set",
        "plan.to_deg=36",
        "--set",
        "plan.step_deg=3.6",
        "--set",
        "model.max_range_m=1.5",
        "--set",
        "motion.settle_ms=4",
    ];
    Daemon::start_mock(folder, &[&own, further].concat())
}

/// Options that reach it.
fn at(daemon: &Daemon) -> [String; 3] {
    ["--daemon".into(), "--socket".into(), daemon.folder.join("s").display().to_string()]
}

fn collect(case: &Case, daemon: &Daemon) -> std::process::Output {
    let at = at(daemon);
    case.collect(&at.each_ref().map(String::as_str))
}

fn spawn(case: &Case, daemon: &Daemon) -> std::process::Child {
    let at = at(daemon);
    let arguments = case.arguments(&at.each_ref().map(String::as_str));
    sonard(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

fn is_taking(case: &Case) -> bool {
    case.path("out/in-progress").exists() && !case.files("in-progress").is_empty()
}

#[test]
fn daemon_settings_are_restored() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = daemon(folder.path(), &[]);
    daemon.wait_for_scans(1);
    let case = Case::new(
        "[poses]\nlist = [\"fig9\", \"0.5,0.3,45\"]\n[collection]\nrepeats = 2\n\
         [air]\ntemperature_c = 22.5\n[conditions]\ndoor = \"shut\"\n",
    );
    let output = collect(&case, &daemon);
    assert_eq!(output.status.code(), Some(0), "{}", joined_stderr(&output));
    case.assert_each_scan_once(2, 2, 25);
    let log = case.scan("p002-r01.jsonl");
    let session = log.of_type("session").next().expect("a session");
    assert_eq!(
        (&session["provenance"], &session["air"]["temperature_c"]),
        (&json!("mock"), &json!(22.5))
    );
    assert_eq!(session["collection"]["conditions"]["door"], "shut");
    let start = log.of_type("scan_start").next().expect("a start");
    assert_eq!(start["pose"], json!({"x_m": 0.5, "y_m": 0.3, "heading_deg": 45.0}));
    assert_eq!((&start["plan"]["to_deg"], &start["air"]["source"]), (&json!(90.0), &json!("api")));
    assert!(log.pings().iter().all(|ping| ping["sim"].is_object()), "predicted for that pose");
    // What the plan left open is noted as the daemon has it.
    assert_eq!(case.manifest()["plan"]["motion"]["settle_ms"], 4.0);
    assert!(case.text("out/report.md").contains("4 of 4 scans"));

    let status = daemon.status();
    assert_eq!(status["scanning"]["mode"], "continuous");
    assert_eq!((&status["plan"]["to_deg"], &status["pose"]["x_m"]), (&36.0.into(), &0.774.into()));
    wait_until("its own air", || daemon.status()["air"]["source"] == "configuration");
    let before = daemon.health()["scans"]["completed"].as_u64();
    wait_until("its own scans", || daemon.health()["scans"]["completed"].as_u64() > before);
    // Held once, at the beginning: between these scans there was none of the daemon's own.
    assert_eq!(
        (case.entries("saved_settings").len(), case.entries("restored_settings").len()),
        (1, 1)
    );
    assert_eq!(case.entries("saved_settings")[0]["scanning"]["mode"], "continuous");
    let again = collect(&case, &daemon);
    assert_eq!(again.status.code(), Some(0), "{}", joined_stderr(&again));
    assert_eq!(daemon.stop(), Some(0));
    let all = clean_log(folder.path());
    let requested: Vec<_> =
        all.of_type("scan_start").filter(|start| !start["request"].is_null()).collect();
    assert_eq!(requested.len(), 4);
    assert!(requested.iter().any(|of| of["scan"] == start["scan"]), "the daemon logs them, too");
}

#[test]
fn conflicting_settings() {
    let folder = tempfile::tempdir().expect("a folder");
    let thermometer = folder.path().join("t");
    std::fs::write(&thermometer, "21000\n").expect("writable");
    let file = format!("air.file={}", thermometer.display());
    let daemon = daemon(folder.path(), &["--set", &file]);
    let poses = "[poses]\nlist = [\"fig9\"]\n";
    for (plan, parts) in [
        (
            "[motion]\nsettle_ms = 9\nspeed = 800\n".to_owned(),
            ["plan.toml:11:13: motion.settle_ms is 9", "motion.settle_ms of the daemon 4.0"],
        ),
        ("[air]\nhumidity_percent = 40\n".to_owned(), ["air.humidity_percent", "air.file"]),
    ] {
        let case = Case::new(&format!("{poses}{plan}"));
        let output = collect(&case, &daemon);
        let text = joined_stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        assert!(!text.contains("motion.speed"), "that is the same: {text}");
        assert!(!case.path("out").exists());
    }
    let case = Case::new("");
    let place = "[place]\nscene = \"simple-room\"\n[plan]\nto_deg = 90\n[sensor]\n";
    case.write("plan.toml", &format!("{place}sensor = \"pioneer\"\nmax_range_m = 3\n{poses}"));
    let text = joined_stderr(&collect(&case, &daemon));
    assert!(text.contains("sensor pioneer is not the daemon's senscomp-6500"), "{text}");
    assert!(text.contains("model.max_range_m of the daemon 1.5"), "{text}");
    case.write("plan.toml", "[place]\nscene = \"corridor\"\n[poses]\nlist = [\"beside-wall\"]\n");
    let text = joined_stderr(&collect(&case, &daemon));
    assert!(text.contains("its scene simple-room"), "{text}");
    let mock = run(&["collect", "plan.toml", "--daemon", "--seed", "3"]);
    assert_eq!(mock.status.code(), Some(2));
    assert_eq!(daemon.stop(), Some(0));
    // Without a daemon the message names the socket, with one that does not measure its state.
    let case = Case::new(poses);
    let output = case.collect(&["--daemon", "--socket", "/nowhere"]);
    assert!(output.status.code() == Some(3) && joined_stderr(&output).contains("/nowhere"));
    let array = ["--simulate", "--scene", "mcgill-lab", "--pose", "fig4"];
    let daemon = Daemon::start(folder.path(), &array);
    let output = collect(&case, &daemon);
    let text = joined_stderr(&output);
    assert!(output.status.code() == Some(2) && text.contains("simulates an array"), "{text}");
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn resumes_and_restores_the_daemon() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = daemon(folder.path(), &[]);
    let case = Case::new("[poses]\nlist = [\"fig9\"]\n[collection]\nrepeats = 4\n");
    let mut killed = spawn(&case, &daemon);
    wait_until("a scan", || is_taking(&case));
    killed.kill().expect("it runs");
    killed.wait().expect("it ends");
    assert_eq!(daemon.status()["scanning"]["mode"], "on-request", "the mode is not restored");

    let stopped = spawn(&case, &daemon);
    // The daemon may still be at the scan of the one that was killed, which is set aside first.
    wait_until("a scan", || {
        case.path("out/rejected").exists() && case.files("rejected").len() == 1 && is_taking(&case)
    });
    assert_eq!(daemon.send("POST", "/v1/stop", "").status, 202);
    let output = stopped.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(1), "{}", joined_stderr(&output));
    assert!(
        joined_stderr(&output).contains("the daemon was stopped by another client"),
        "{}",
        joined_stderr(&output)
    );
    assert_eq!(daemon.status()["scanning"]["mode"], "continuous");

    let interrupted = spawn(&case, &daemon);
    wait_until("a scan", || is_taking(&case));
    interrupt(interrupted.id());
    let output = interrupted.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(1), "{}", joined_stderr(&output));
    assert_eq!(case.files("in-progress"), Vec::<String>::new());
    assert_eq!(daemon.status()["scanning"]["mode"], "continuous");

    let output = collect(&case, &daemon);
    assert_eq!(output.status.code(), Some(0), "{}", joined_stderr(&output));
    case.assert_each_scan_once(1, 4, 25);
    let cut: Vec<Log> = case
        .files("rejected")
        .iter()
        .map(|name| Log::read(&case.path("out/rejected").join(name)))
        .collect();
    assert!(cut.len() >= 2, "{} scans were cut", cut.len());
    assert_eq!(daemon.status()["scanning"]["mode"], "continuous");
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn waits_for_a_lost_daemon() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = daemon(folder.path(), &[]);
    let case = Case::new("[poses]\nlist = [\"fig9\"]\n[collection]\nrepeats = 3\n");
    let child = spawn(&case, &first);
    wait_until("a scan", || is_taking(&case));
    first.kill();
    let second = daemon(folder.path(), &[]);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0), "{}", joined_stderr(&output));
    case.assert_each_scan_once(1, 3, 25);
    assert_eq!(second.status()["scanning"]["mode"], "continuous");
    assert_eq!(second.stop(), Some(0));
}
