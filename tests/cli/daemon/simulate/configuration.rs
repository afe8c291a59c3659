//! Configurations: read again, and wrong.

use super::*;

#[test]
fn reload_of_scene_and_array() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("sonard.toml");
    let text = |scene: &str, array: &str, noise_mm: f64| {
        format!(
            "[place]\nscene = \"{scene}\"\npose = \"1.2,1,30\"\n[simulate]\narray = \"{array}\"\nnoise_mm = {noise_mm}\n"
        )
    };
    fs::write(&file, text("mcgill-lab", "pioneer-8", 0.0)).expect("writes");
    let config = file.display().to_string();
    let mut daemon = InProcess::start(folder.path(), &["--simulate", "--config", &config]);
    daemon.wait_for_scans(1);
    fs::write(&file, text("two-surface-room", "pioneer-7", 2.0)).expect("writes");
    daemon.reload();
    daemon.wait_until("the other array", || daemon.status()["simulation"]["array"] == "pioneer-7");
    let scans = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    daemon.wait_for_scans(scans + 4);
    // A scan of the other scene is still drawn and looked into in its own.
    let scans = daemon.get("/v1/scans?limit=500").json();
    let first = scans.as_array().and_then(|scans| scans.last()).expect("scans")["scan"].clone();
    let first = first.as_str().expect("an id").to_owned();
    assert_eq!(daemon.get(&format!("/v1/scans/{first}/scene")).json()["name"], "mcgill-lab");
    assert_eq!(
        daemon.get(&format!("/v1/scans/{first}/beams/0")).json()["unavailable_reason"],
        Value::Null
    );
    // An invalid configuration changes nothing and is logged.
    fs::write(&file, text("two-surface-room", "pioneer-9", 2.0)).expect("writes");
    daemon.reload();
    daemon.wait_until("the refusal", || daemon.status()["configuration"]["error"].is_string());
    assert_eq!(daemon.status()["simulation"]["array"], "pioneer-7");
    daemon.stop();
    let log = clean_log(folder.path());
    let sessions: Vec<_> = log
        .of_type("session")
        .map(|session| (session["scene"]["name"].clone(), session["array"]["name"].clone()))
        .collect();
    let expected = [("mcgill-lab", "pioneer-8"), ("two-surface-room", "pioneer-7")];
    assert_eq!(sessions, expected.map(|(scene, array)| (json!(scene), json!(array))));
    // With noise, the readings of a stationary robot vary.
    let pings = log.pings();
    let ranges: Vec<f64> = pings
        .iter()
        .rev()
        .filter(|ping| ping["ranger"] == "s0")
        .filter_map(|ping| ping["range_m"].as_f64())
        .take(3)
        .collect();
    assert!(ranges.windows(2).any(|pair| pair[0] != pair[1]), "{ranges:?}");
    assert!(ranges.iter().all(|m| (m - ranges[0]).abs() < 0.05), "{ranges:?}");
}

#[test]
fn wrong_configurations() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log").display().to_string();
    let socket = folder.path().join("s").display().to_string();
    let course = folder.path().join("course.jsonl");
    fs::write(&course, "{\"x_m\":3,\"y_m\":1.2}\n{\"x_m\":30,\"y_m\":1.2}\n").expect("writes");
    let course = format!("simulate.course={}", course.display());
    let lab = ["--scene", "mcgill-lab", "--pose", "3,1.2,0"];
    for (arguments, parts) in [
        (&["--simulate"][..], &["needs a scene"][..]),
        (&["--simulate", "--mock", "--scene", "mcgill-lab"], &["--mock"]),
        (&["--simulate", "--port", "/dev/ttyACM0"], &["--port"]),
        (&["--array", "pioneer-8"], &["--simulate"]),
        (
            &[&["--simulate", "--array", "pioneer-9"], &lab[..]].concat(),
            &["pioneer-9", "did you mean"],
        ),
        (&["--simulate", "--scene", "mcgill-lab", "--pose", "99,0,0"], &["outside"]),
        (
            &["--simulate", "--scene", "mcgill-lab", "--pose", "5.55,1.2,0"],
            &["ranger s", "outside"],
        ),
        (&["--simulate", "--scene", "mcgill-lab", "--set", &course], &["pose 2", "outside"]),
        (
            &[&["--simulate", "--set", "simulate.interval_ms=0"], &lab[..]].concat(),
            &["simulate.interval_ms", "1 to 10000"],
        ),
        (&[&["--simulate", "--set", "simulate.arrray=x"], &lab[..]].concat(), &["arrray", "array"]),
        (&[&["--simulate", "--set", "model.sensor=pionier"], &lab[..]].concat(), &["pioneer"]),
    ] {
        let output = run(&[&["run", "--log", &log, "--socket", &socket], arguments].concat());
        let printed = stderr(&output).replace(['\n', '\u{2502}'], " ");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {printed}");
        for part in parts {
            assert!(printed.contains(part), "{arguments:?}: {part:?} is not in: {printed}");
        }
    }
}
