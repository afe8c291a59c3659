//! Scans requested during other work, with their own plan or from the command
//! line, and changes at run time.

use std::{
    io::{BufRead as _, BufReader, Write as _},
    process::Stdio,
    time::Duration,
};

use serde_json::{Value, json};
use sonard_test_support::in_process::Daemon as InProcess;

use super::{Daemon, write_token};
use crate::common::{Log, interrupt, sonard, stderr, wait_until};

const SHORT: [&str; 6] =
    ["--set", "plan.to_deg=36", "--set", "model.max_range_m=2", "--set", "plan.step_deg=3.6"];

/// `sonard scan --daemon` at the daemon, with further options.
fn scan(daemon: &Daemon, further: &[&str]) -> std::process::Command {
    let socket = daemon.folder.join("s");
    let socket = socket.to_str().expect("plain path");
    let mut command = sonard(&["scan", "--daemon", "--socket", socket]);
    command.args(further).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

#[test]
fn scan_with_its_own_plan() {
    let folder = tempfile::tempdir().expect("a folder");
    let continuous = ["--set", "scanning.mode=continuous"];
    let daemon = Daemon::start_mock(folder.path(), &[&SHORT[..], &continuous].concat());
    daemon.wait_for_scans(1);
    let out = folder.path().join("out");
    let own =
        ["--scene", "simple-room", "--pose", "0.5,0.3,90", "--to-deg", "90", "--step-deg", "1.8"];
    let taken = scan(&daemon, &own)
        .args(["--repeat", "2", "--out", out.to_str().expect("plain path")])
        .output()
        .expect("it runs");
    assert_eq!(taken.status.code(), Some(0), "{}", stderr(&taken));
    let reported = stderr(&taken);
    for part in ["takes 2 scans, ", "scan 2 of 2 started: 50 beams", "mock", "echoes agree"] {
        assert!(reported.contains(part), "{part}: {reported}");
    }
    let log = Log::read(&out.join("scan.jsonl"));
    let starts: Vec<_> = log.of_type("scan_start").collect();
    assert_eq!(starts.len(), 2);
    for start in starts {
        assert_eq!(start["pose"], json!({"x_m": 0.5, "y_m": 0.3, "heading_deg": 90.0}));
        assert_eq!(start["plan"]["to_deg"], 90.0);
    }
    assert_eq!(log.pings().len(), 100);
    assert!(log.pings().iter().all(|ping| ping["sim"].is_object()), "predictions for that pose");
    assert_eq!(log.of_type("session").count(), 1);
    assert!(out.join("scan.png").exists() && out.join("scan.svg").exists());
    let verified =
        crate::common::run(&["log", "verify", out.join("scan.jsonl").to_str().expect("plain")]);
    assert_eq!(verified.status.code(), Some(0));
    let status = daemon.status();
    assert_eq!((&status["plan"]["to_deg"], &status["pose"]["x_m"]), (&36.0.into(), &0.774.into()));
    let before = daemon.health()["scans"]["completed"].as_u64();
    wait_until("its own scans again", || daemon.health()["scans"]["completed"].as_u64() > before);

    // Rejected: another scene, another sensor, a pose in a wall, a daemon that is not running.
    let corridor = scan(&daemon, &["--scene", "corridor", "--pose", "beside-wall"]).output();
    let corridor = corridor.expect("it runs");
    let printed = stderr(&corridor).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        corridor.status.code() == Some(2) && printed.contains("its scene simple-room"),
        "{printed}"
    );
    let sensor = [&own[..], &["--sensor", "pioneer"]].concat();
    assert_eq!(scan(&daemon, &sensor).output().expect("it runs").status.code(), Some(2));
    let wrong = daemon.send("POST", "/v1/start", r#"{"pose":{"x_m":9,"y_m":9,"heading_deg":0}}"#);
    assert_eq!(wrong.status, 409);
    assert_eq!(daemon.stop(), Some(0));
    let absent = sonard(&["scan", "--daemon", "--socket", "/nowhere"]).args(own).output();
    assert_eq!(absent.expect("it runs").status.code(), Some(3));
}

#[test]
fn token_over_tcp() {
    let folder = tempfile::tempdir().expect("a folder");
    let token = write_token(folder.path(), "correct horse battery\n");
    let token = token.to_str().expect("plain path").to_owned();
    let token_key = format!("server.token_file={token}");
    let tcp = ["--set", "server.listen=127.0.0.1:0", "--set", &token_key];
    let daemon = Daemon::start_mock(folder.path(), &[&SHORT[..], &tcp].concat());
    daemon.wait_for("ready");
    let address = daemon.address();
    let request = |arguments: &[&str]| {
        let command = [arguments, &["--address", &address]].concat();
        let output = sonard(&command).env_remove("SONARD_SERVER_TOKEN_FILE").output();
        let output = output.expect("it runs");
        let printed = stderr(&output).split_whitespace().collect::<Vec<_>>().join(" ");
        (output.status.code(), printed, String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let (code, printed, status) = request(&["status"]);
    assert!(code == Some(0) && status.contains("MOCK-00001"), "{printed}");
    let scan = ["scan", "--daemon", "--scene", "simple-room", "--pose", "fig7", "--to-deg", "36"];
    let (code, printed, _) = request(&scan);
    assert!(code == Some(3) && printed.contains("token is missing or wrong"), "{printed}");
    let (code, printed, log) = request(&[&scan[..], &["--token-file", &token]].concat());
    assert_eq!(code, Some(0), "{printed}");
    Log::parse(&log).assert_each_beam_once(40);
    for (wrong, part) in [
        (&["--address", "localhost:1", "--token-file", "/nowhere"][..], "cannot read the token"),
        (&["--address", "https://robot.local/"], "plain HTTP"),
    ] {
        let output = sonard(&["status"]).args(wrong).output().expect("it runs");
        let printed = stderr(&output).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(output.status.code() == Some(2) && printed.contains(part), "{printed}");
    }
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn requested_air_is_reset() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &SHORT);
    assert_eq!(daemon.send("PUT", "/v1/air", r#"{"temperature_c":25}"#).status, 202);
    daemon.wait_until("the air", || daemon.get("/v1/air").json()["source"] == "api");
    assert_eq!(daemon.send("DELETE", "/v1/air", "").status, 202);
    daemon.wait_until("its own air", || daemon.get("/v1/air").json()["source"] == "configuration");
    let air = daemon.get("/v1/air").json();
    assert_eq!((&air["temperature_c"], &air["age_s"]), (&json!(20.0), &Value::Null));
    let setup = daemon.get("/v1/setup").json();
    assert_eq!(setup["model"]["max_range_m"], 2.0);
    assert_eq!(
        (&setup["sensor"]["name"], &setup["thermometer"]),
        (&json!("senscomp-6500"), &json!(false))
    );
    daemon.stop();
}

#[test]
fn wait_is_interruptible() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &SHORT);
    // Scans take so long that the first one is running when it is ended.
    let own = ["--scene", "simple-room", "--pose", "fig9", "--step-deg", "0.9", "--repeat", "50"];
    for by_stop in [false, true] {
        let mut child = scan(&daemon, &own).spawn().expect("it runs");
        let mut notices = BufReader::new(child.stderr.take().expect("piped")).lines();
        let is_started = notices.any(|line| line.expect("text").contains("scan 1 of 50 started"));
        assert!(is_started);
        wait_until("beams", || daemon.status()["scan"]["done"].as_u64() > Some(3));
        if by_stop {
            assert_eq!(daemon.send("POST", "/v1/stop", "").status, 202);
        } else {
            interrupt(child.id());
        }
        let rest: Vec<String> = notices.map(|line| line.expect("text")).collect();
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(1), "{rest:?}");
        let log = Log::parse(&String::from_utf8_lossy(&output.stdout));
        assert!(log.end()["missing"].as_u64() > Some(0), "the scan was closed");
        wait_until("rest", || daemon.status()["scan"].is_null());
        assert_eq!(daemon.status()["scanning"]["requested"], 0);
    }
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn change_of_mode() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &SHORT);
    daemon.wait_for("ready");
    assert_eq!(daemon.get("/v1/scanning").json(), json!({"mode": "on-request", "every_s": 60.0}));
    assert_eq!(daemon.send("PUT", "/v1/scanning", r#"{"mode":"continuous"}"#).status, 202);
    daemon.wait_for_scans(3);
    let scheduled = r#"{"mode":"schedule","every_s":3600}"#;
    assert_eq!(daemon.send("PUT", "/v1/scanning", scheduled).status, 202);
    // The schedule begins at once, and then waits for an hour.
    daemon.wait_until("the wait", || {
        daemon.status()["scanning"]["next_in_s"].as_f64() > Some(3500.0)
    });
    assert_eq!(daemon.send("PUT", "/v1/scanning", r#"{"mode":"on-request"}"#).status, 202);
    daemon.wait_until("rest", || daemon.status()["scan"].is_null());
    let status = daemon.status();
    assert_eq!(
        (&status["scanning"]["mode"], &status["scanning"]["every_s"]),
        (&"on-request".into(), &3600.0.into())
    );
    for (body, code) in [
        (r#"{"mode":"schedule","every_s":0}"#, 422),
        (r#"{"mode":"often"}"#, 422),
        (r#"{"mode":"schedule","every":1}"#, 422),
    ] {
        assert_eq!(daemon.send("PUT", "/v1/scanning", body).status, code, "{body}");
    }
    let unknown = format!(r#"{{"request":"{}"}}"#, "6ba7b810-9dad-11d1-80b4-00c04fd430c8");
    assert_eq!(daemon.send("POST", "/v1/cancel", &unknown).status, 404);
    daemon.stop();
}

#[test]
fn link_counters_during_a_scan() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &["--set", "model.max_range_m=4"]);
    daemon.wait_for("ready");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    let done = || daemon.status()["scan"]["done"].as_u64();
    daemon.wait_until("beams", || done() > Some(3));
    let mut received = Vec::new();
    for _ in 0..4 {
        received.push(daemon.health()["line"]["bytes_received"].as_u64().expect("a count"));
        daemon.pass(Duration::from_millis(300));
    }
    assert!(done() < Some(400), "still the same scan");
    assert!(received.windows(2).all(|pair| pair[1] > pair[0]), "{received:?}");
    daemon.stop();
}

#[test]
fn scans_with_deadband() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &SHORT);
    daemon.wait_for("ready");
    let mut stream = daemon.connect();
    let request = "GET /v1/live/scans?moved_m=0.05 HTTP/1.1\r\nHost: localhost\r\n\r\n";
    stream.write_all(request.as_bytes()).expect("it listens");
    let mut lines = BufReader::new(stream).lines().map(|line| line.expect("a line"));
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":2}"#).status, 202);
    let mut next = || -> Value {
        lines
            .find_map(|line| serde_json::from_str(&line).ok().filter(Value::is_object))
            .expect("a scan")
    };
    let counts = [next(), next()].map(|scan| scan["pings"].as_array().map_or(0, Vec::len));
    assert_eq!(counts, [10, 0], "nothing moved in between");
    assert_eq!(daemon.get("/v1/live/scans?moved_m=-1").status, 422);
    daemon.stop();
}
