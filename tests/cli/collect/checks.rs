//! Checks between scans and their actions.

use std::thread;

use super::{Case, joined_stderr};
use crate::common::{stderr, wait_until};

const POSE: &str = "[poses]\nlist = [\"fig9\"]\n";

#[test]
fn missed_steps_cause_a_retake() {
    let case = Case::new(&format!("{POSE}[collection]\nrepeats = 6\nretakes = 50\n"));
    let output = case.collect_all(&["--missed-steps", "0.03", "--seed", "3"]);
    case.assert_each_scan_once(1, 6, 25);
    let aside = case.files("rejected");
    assert!(!aside.is_empty(), "no scan was refused: {}", stderr(&output));
    for name in &aside {
        let log = crate::common::Log::read(&case.path("out/rejected").join(name));
        assert_ne!(log.end()["home_drift_steps"], 0, "{name}");
        let events = log.events();
        assert!(events.iter().any(|event| event.contains("does not count")), "{events:?}");
    }
    for take in case.entries("attempt") {
        let drift = take["figures"]["home_drift_steps"].as_i64().expect("a figure");
        assert_eq!(take["outcome"] == "accepted", drift == 0, "{take}");
    }
    let report = case.text("out/report.md");
    assert!(
        report.contains("Rejected and retaken") && report.contains("the motor missed steps"),
        "{report}"
    );
    assert_eq!(case.manifest()["counts"]["set_aside"], aside.len());
}

#[test]
fn retakes_exhausted() {
    let plan = format!("{POSE}[collection]\nrepeats = 2\nretakes = 2\n");
    let case = Case::new(&plan);
    let output = case.collect(&["--missed-steps", "1"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let aside =
        ["p001-r01", "p001-r02"].map(|stem| [1, 2, 3].map(|n| format!("{stem}-attempt{n}.jsonl")));
    assert_eq!(case.files("rejected"), aside.concat());
    assert_eq!(case.manifest()["counts"]["given_up"], 2);
    let report = case.text("out/report.md");
    assert!(report.contains("## Failed") && report.contains("Scanning time 0 s"), "{report}");
    // They stay abandoned until they are requested.
    case.collect(&[]);
    assert_eq!(case.files("scans").len(), 0);
    case.collect_all(&["--retry-failed"]);
    case.assert_each_scan_once(1, 2, 25);

    let case = Case::new(&(plan + "after_retakes = \"stop\"\n"));
    let output = case.collect(&["--missed-steps", "1"]);
    assert!(output.status.code() == Some(1) && joined_stderr(&output).contains("2 retakes failed"));
    assert_eq!(case.files("rejected").len(), 3);

    let case = Case::new(&format!("{POSE}[checks]\non_home_drift = \"note\"\n"));
    case.collect_all(&["--missed-steps", "1"]);
    assert!(case.text("out/report.md").contains("## Findings"));
}

#[test]
fn missing_beams_and_wrong_scene() {
    let case = Case::new(&format!(
        "{POSE}[collection]\nretakes = 0\n[checks]\nmax_unexplained_share = 0.3\non_unexplained = \"stop\"\n"
    ));
    let output = case.collect(&["--truth", "corridor"]);
    let text = joined_stderr(&output);
    assert!(output.status.code() == Some(1) && text.contains("check pose and scene"), "{text}");
    assert_eq!(case.files("rejected").len(), 1);
    case.collect_all(&[]);

    let case = Case::new(&format!("{POSE}[collection]\nretakes = 40\n"));
    let output = case.collect_all(&["--faults", "stuck_echo=0.04"]);
    case.assert_each_scan_once(1, 1, 25);
    assert!(
        joined_stderr(&output).contains("have no usable reading: to be retaken"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn drifting_air_starts_a_session() {
    // The program that gives the second pose heats the room.
    let case = Case::new("");
    let thermometer = case.path("thermometer").display().to_string();
    case.write("thermometer", "20000\n");
    let program = format!(
        "if [ $SONARD_POSE = 1 ]; then echo fig9; elif [ $SONARD_POSE = 2 ]; then echo 26000 > \
         {thermometer}; echo fig7; fi"
    );
    case.write(
        "plan.toml",
        &format!(
            "{}[air]\nfile = \"{thermometer}\"\n[poses]\nprogram = \"{program}\"\n[collection]\nrepeats = 2\n",
            super::SHORT
        ),
    );
    let output = case.collect_all(&[]);
    case.assert_each_scan_once(2, 2, 25);
    assert!(joined_stderr(&output).contains("+6.00 C from the session's"), "{}", stderr(&output));
    for (name, temperature_c, speed) in
        [("p001-r02.jsonl", 20.0, 343.99), ("p002-r01.jsonl", 26.0, 347.6)]
    {
        let log = case.scan(name);
        let session = log.of_type("session").next().expect("a session");
        assert_eq!(session["air"]["temperature_c"], temperature_c);
        let sound = session["air"]["sound_speed_m_s"].as_f64().expect("a speed");
        assert!((sound - speed).abs() < 0.2, "{sound}");
        let start = log.of_type("scan_start").next().expect("a start");
        assert_eq!(start["air"]["source"], "file");
    }

    let plan = case.text("plan.toml") + "[checks]\non_temperature_drift = \"stop\"\n";
    let case = Case::new("");
    case.write("plan.toml", &plan);
    std::fs::write(&thermometer, "20000\n").expect("writable");
    let output = case.collect(&[]);
    assert!(
        output.status.code() == Some(1)
            && joined_stderr(&output).contains("stopped: air temperature 26.00")
    );
    assert_eq!(case.files("scans").len(), 2);
}

#[test]
fn air_change_within_a_scan() {
    let case = Case::new(POSE);
    let thermometer = case.path("thermometer");
    let plan = format!("{}[air]\nfile = \"{}\"\n", case.text("plan.toml"), thermometer.display());
    case.write("plan.toml", &plan);
    case.write("thermometer", "20000\n");
    let taking = case.path("out/in-progress/p001-r01.jsonl");
    // A door opens during the first scan.
    let warming = thread::spawn(move || {
        wait_until("the scan", || taking.exists());
        std::fs::write(&thermometer, "17000\n").expect("writable");
    });
    let output = case.collect_all(&["--realtime"]);
    warming.join().expect("no panic");
    assert!(
        joined_stderr(&output).contains("-3.00 C during the scan: to be retaken"),
        "{}",
        stderr(&output)
    );
    assert_eq!(case.files("rejected").len(), 1);
    case.assert_each_scan_once(1, 1, 25);
}
