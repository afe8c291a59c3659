//! Scans on request, and changes of what is in force.

use sonard_test_support::in_process::Daemon as InProcess;

use super::*;

#[test]
fn requested_scans() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &SHORT);
    daemon.wait_for("ready");
    daemon.pass(Duration::from_millis(300));
    assert_eq!(daemon.get("/v1/scan/latest").status, 404, "nothing is scanned unasked");
    for (method, path, body) in [
        ("PUT", "/v1/plan", r#"{"from_deg":-9,"to_deg":9,"step_deg":0.9,"pings_per_stop":2}"#),
        ("PUT", "/v1/pose", r#"{"x_m":0.5,"y_m":0.3,"heading_deg":90}"#),
        ("PUT", "/v1/air", r#"{"temperature_c":25}"#),
        ("POST", "/v1/start", r#"{"scans":2}"#),
    ] {
        let reply = daemon.send(method, path, body);
        assert_eq!(reply.status, 202, "{path}: {}", reply.json());
    }
    daemon.wait_for_scans(2);
    let latest = daemon.get("/v1/scan/latest").json();
    assert_eq!(latest["pings"].as_array().map(Vec::len), Some(40), "{latest}");
    assert_eq!(latest["start"]["pose"]["heading_deg"], 90.0);
    let air = &latest["start"]["air"];
    assert_eq!((&air["temperature_c"], &air["source"]), (&json!(25.0), &json!("api")));
    assert!(air["age_s"].as_f64().is_some_and(|age_s| (0.0..20.0).contains(&age_s)), "{air}");
    // A plan off the motor's steps is refused while the motor is known.
    let off = daemon.send(
        "PUT",
        "/v1/plan",
        r#"{"from_deg":0,"to_deg":9,"step_deg":1,"pings_per_stop":1}"#,
    );
    assert_eq!(off.status, 409);
    assert!(off.json()["error"].as_str().is_some_and(|error| error.contains("0.9")));
    daemon.stop();
    let log = clean_log(folder.path());
    assert_eq!(log.of_type("scan_end").count(), 2);
    assert_eq!(log.of_type("session").count(), 1);
}

#[test]
fn settings_change_together_or_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &SHORT);
    daemon.wait_for("ready");
    let before = daemon.status();
    let good = json!({
        "pose": {"x_m": 0.5, "y_m": 0.3, "heading_deg": 90.0},
        "plan": {"from_deg": 0.0, "to_deg": 18.0, "step_deg": 0.9, "pings_per_stop": 1},
        "air": {"temperature_c": 25.0},
        "sensor": {"threshold": 0.03},
    });
    for (part, value, status, field) in [
        ("pose", json!({"x_m": 9.0, "y_m": 0.3, "heading_deg": 0.0}), 409, "pose"),
        ("air", json!({"temperature_c": 99.0}), 422, "air.temperature_c"),
        ("sensor", json!({"preset": "hc-sr04"}), 409, "sensor.blanking_us"),
        ("sensor", json!({"threshold": 5.0}), 422, "sensor.threshold"),
        (
            "plan",
            json!({"from_deg": 0.0, "to_deg": 9.0, "step_deg": 1.0, "pings_per_stop": 1}),
            409,
            "plan.step_deg",
        ),
    ] {
        let mut order = good.clone();
        order[part] = value;
        let reply = daemon.send("PUT", "/v1/settings", &order.to_string());
        assert_eq!((reply.status, &reply.json()["field"]), (status, &json!(field)), "{order}");
        let now = daemon.status();
        for part in ["pose", "plan", "air", "sensor"] {
            assert_eq!(now[part], before[part], "{order}");
        }
    }
    assert_eq!(daemon.send("PUT", "/v1/settings", &good.to_string()).status, 202);
    let now = daemon.status();
    assert_eq!((&now["pose"], &now["plan"]), (&good["pose"], &good["plan"]));
    assert_eq!(now["air"]["temperature_c"], 25.0);
    assert_eq!(now["sensor"]["threshold"], 0.03);
    // What is left out stays.
    let air = json!({"air": {"temperature_c": 21.0}}).to_string();
    assert_eq!(daemon.send("PUT", "/v1/settings", &air).status, 202);
    assert_eq!(daemon.status()["pose"], good["pose"]);
    daemon.stop();
}

/// Residuals of a scan taken after the pose was changed.
fn median_residual_m(further: &[&str]) -> f64 {
    let folder = tempfile::tempdir().expect("a folder");
    let options = [&["--set", "plan.step_deg=3.6"], further].concat();
    let daemon = InProcess::start_mock(folder.path(), &options);
    daemon.wait_for("ready");
    let pose = r#"{"x_m":0.5,"y_m":0.3,"heading_deg":90}"#;
    assert_eq!(daemon.send("PUT", "/v1/pose", pose).status, 202);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    let fit = daemon.health()["fit"].clone();
    daemon.stop();
    fit["median_abs_residual_m"].as_f64().expect("a fit")
}

#[test]
fn mock_follows_the_pose() {
    assert!(median_residual_m(&[]) < 0.002);
    assert!(median_residual_m(&["--truth-pose", "fig9"]) > 0.02);
}

#[test]
fn stop_and_resume() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &["--set", "scanning.mode=continuous"]);
    daemon.wait_until("some beams", || daemon.status()["scan"]["done"].as_u64() >= Some(5));
    assert_eq!(daemon.send("POST", "/v1/stop", "").status, 202);
    daemon.wait_for("ready");
    let health = daemon.health();
    assert_eq!(
        (&health["scans"]["stopped"], &health["scans"]["completed"]),
        (&json!(1), &json!(0))
    );
    daemon.pass(Duration::from_millis(300));
    assert_eq!(daemon.status()["scanning"]["paused"], true);
    assert_eq!(daemon.send("POST", "/v1/start", "{}").status, 202);
    daemon.wait_until("the next scan", || daemon.status()["scan"]["done"].as_u64() >= Some(2));
    daemon.stop();
    let log = clean_log(folder.path());
    let stops: Vec<String> = log.events().into_iter().filter(|e| e.contains("stopped")).collect();
    assert!(
        stops[0].contains("on request") && stops[1].contains("daemon is stopping"),
        "{stops:?}"
    );
}

#[test]
fn pending_changes() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("s.toml");
    fs::write(&file, "[plan]\nto_deg = 360\n").expect("a file");
    let config = ["--config", file.to_str().expect("plain path"), "--set", "motion.settle_ms=50"];
    let mut daemon = InProcess::start_mock(folder.path(), &config);
    daemon.wait_for("ready");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_until("beams", || daemon.status()["scan"]["done"].as_u64() >= Some(2));
    assert_eq!(daemon.status()["pending"]["plan"], Value::Null);
    let half = json!({"from_deg": 0.0, "to_deg": 180.0, "step_deg": 0.9, "pings_per_stop": 1});
    for (path, body) in [
        ("/v1/plan", half.to_string()),
        ("/v1/pose", r#"{"x_m":0.5,"y_m":0.3,"heading_deg":0}"#.to_owned()),
        ("/v1/air", r#"{"temperature_c":25}"#.to_owned()),
        ("/v1/scanning", r#"{"mode":"schedule","every_s":3600}"#.to_owned()),
    ] {
        assert_eq!(daemon.send("PUT", path, &body).status, 202, "{path}");
    }
    // No wait: who has his answer finds what he ordered.
    let status = daemon.status();
    assert_eq!((&status["plan"]["to_deg"], &status["pending"]["plan"]), (&json!(360.0), &half));
    assert_eq!(status["pending"]["pose"]["x_m"], 0.5);
    assert_eq!(status["pending"]["air"]["temperature_c"], 25.0);
    assert_eq!(
        (&status["air"]["temperature_c"], &status["pose"]["x_m"]),
        (&json!(20.0), &json!(0.774))
    );
    assert_eq!(status["scanning"]["mode"], "schedule");
    let plan = daemon.get("/v1/plan").json();
    assert_eq!((&plan["to_deg"], &plan["pending"]), (&json!(360.0), &half));
    assert_eq!(daemon.get("/v1/air").json()["pending"]["temperature_c"], 25.0);
    assert_eq!(daemon.get("/v1/pose").json()["pending"]["x_m"], 0.5);
    let shown = String::from_utf8(daemon.run_client("status").stdout).expect("text");
    assert!(shown.contains("pending  with the next scan: sweep 0.0 to 180.0"), "{shown}");

    // The configuration that is read again, and what is wrong with it, likewise.
    fs::write(&file, "[plan]\nto_dge = 90\n").expect("a file");
    daemon.reload();
    daemon.wait_until("the refusal", || daemon.status()["configuration"]["error"].is_string());
    fs::write(&file, "[plan]\nto_deg = 90\n[motion]\nsettle_ms = 60\n").expect("a file");
    daemon.reload();
    daemon.wait_until("the new plan", || daemon.status()["pending"]["plan"]["to_deg"] == 90.0);
    let status = daemon.status();
    assert_eq!(status["configuration"]["error"], Value::Null);
    assert_eq!(status["plan"]["to_deg"], 360.0);
    assert!(status["scan"].is_object(), "all that in one scan");

    // Nothing is pending without a scan under way.
    assert_eq!(daemon.send("POST", "/v1/stop", "").status, 202);
    daemon.wait_until("rest", || daemon.status()["scan"].is_null());
    let status = daemon.status();
    assert_eq!(status["plan"]["to_deg"], 90.0);
    assert!(status["pending"].as_object().expect("an object").values().all(Value::is_null));
    assert_eq!(daemon.get("/v1/plan").json().get("pending"), None);
    daemon.stop();
}
