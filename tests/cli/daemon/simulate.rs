//! `sonard run --simulate`: an array of rangers from the model, served as if it were there.

mod configuration;

use std::{
    fs,
    io::{BufRead as _, BufReader, Write as _},
    path::Path,
    time::Duration,
};

use jiff::Timestamp;
use serde_json::{Value, json};
use sonard_test_support::in_process::{Connection, Daemon as InProcess};

use super::{Daemon, clean_log, logs};
use crate::common::{Log, run, sonard, stderr, wait_until};

const IDS: [&str; 8] = ["s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7"];

fn start(folder: &Path, further: &[&str]) -> Daemon {
    let array = ["--simulate", "--array", "pioneer-8", "--scene", "mcgill-lab"];
    Daemon::start(folder, &[&array, further].concat())
}

/// An array in the laboratory, within the test's process.
fn in_process(folder: &Path, pose: &[&str], further: &[&str]) -> InProcess {
    let array = ["--simulate", "--array", "pioneer-8", "--scene", "mcgill-lab"];
    InProcess::start(folder, &[&array, pose, further].concat())
}

/// Starts a stationary simulated array in the laboratory.
fn start_stationary(folder: &Path, further: &[&str]) -> Daemon {
    start(folder, &[&["--pose", "3,1.2,20"], further].concat())
}

/// Subscriber of a stream of records.
struct Subscriber(BufReader<Connection>);

impl Subscriber {
    fn new(daemon: &InProcess, path: &str) -> Self {
        let mut stream = daemon.connect();
        stream.set_read_timeout(Duration::from_millis(100));
        let request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n");
        stream.write_all(request.as_bytes()).expect("it listens");
        Self(BufReader::new(stream))
    }

    /// Records received within some seconds of simulated time.
    fn receive_for(&mut self, seconds: f64) -> Vec<Value> {
        let until = self.0.get_ref().now() + Duration::from_secs_f64(seconds);
        let (mut received, mut line) = (Vec::new(), Vec::new());
        while self.0.get_ref().now() < until {
            // A read that times out keeps what it has read.
            if self.0.read_until(b'\n', &mut line).is_ok_and(|count| count > 0) {
                received.extend(serde_json::from_slice(&line).ok().filter(Value::is_object));
                line.clear();
            }
        }
        received
    }
}

/// Records that a new subscriber receives within some seconds of simulated time.
fn receive_for(daemon: &InProcess, path: &str, seconds: f64) -> Vec<Value> {
    Subscriber::new(daemon, path).receive_for(seconds)
}

fn pings(received: &[Value]) -> Vec<&Value> {
    received.iter().filter(|record| record["type"] == "ping").collect()
}

/// Returns the readings of `sonard simulate` at a pose: status and range by ranger.
fn predicted(pose: &str) -> Vec<(Value, Value)> {
    let output =
        run(&["simulate", "--scene", "mcgill-lab", "--pose", pose, "--array", "pioneer-8"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let log = Log::parse(&String::from_utf8_lossy(&output.stdout));
    log.pings().iter().map(|ping| (ping["status"].clone(), ping["range_m"].clone())).collect()
}

/// Returns the readings of the daemon's rangers.
fn reported(daemon: &InProcess) -> Vec<(Value, Value)> {
    let status = daemon.status();
    let readings = status["simulation"]["readings"].as_array().expect("an array").clone();
    readings.iter().map(|reading| (reading["status"].clone(), reading["range_m"].clone())).collect()
}

#[test]
fn records_are_marked_simulated() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = in_process(folder.path(), &["--pose", "3,1.2,20"], &[]);
    daemon.wait_for_scans(1);
    let received = receive_for(&daemon, "/v1/live/records", 2.0);
    for record in &received {
        assert_eq!(record["provenance"], "simulated", "{record}");
    }
    let pings = pings(&received);
    let fired: Vec<Timestamp> = pings
        .iter()
        .map(|ping| ping["time"].as_str().and_then(|time| time.parse().ok()).expect("a time"))
        .collect();
    let first = IDS.iter().position(|id| pings[0]["ranger"] == *id).expect("a ranger");
    for (at, ping) in pings.iter().enumerate() {
        assert_eq!(ping["ranger"], IDS[(first + at) % 8], "in turn");
    }
    assert!(fired.is_sorted(), "one after the other");

    let status = daemon.run_client("status");
    assert_eq!(status.status.code(), Some(0), "{}", stderr(&status));
    let printed = String::from_utf8_lossy(&status.stdout).into_owned();
    assert!(
        printed.contains("SIMULATED") && printed.contains("pioneer-8, one ranger every 40"),
        "{printed}"
    );
    let metrics = String::from_utf8(daemon.get("/metrics").body).expect("text");
    assert!(metrics.contains("sonard_simulated 1"), "{metrics}");
    assert!(daemon.status()["device"].is_null() && daemon.status()["link"]["port"] == "");
    daemon.stop();
    let log = clean_log(folder.path());
    assert_eq!(log.of_type("session").count(), 1);
    let session = log.of_type("session").next().expect("a session");
    assert_eq!(
        (&session["provenance"], &session["array"]["name"]),
        (&json!("simulated"), &json!("pioneer-8"))
    );
}

#[test]
fn readings_after_a_pose_change() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = in_process(folder.path(), &["--pose", "3,1.2,20"], &[]);
    daemon.wait_for_scans(1);
    assert_eq!(reported(&daemon), predicted("3,1.2,20"));
    for pose in ["2.2,1.4,110", "2.2,1.4,-70"] {
        let [x, y, deg] = pose.split(',').collect::<Vec<_>>()[..] else { panic!("a pose") };
        let body = format!("{{\"x_m\":{x},\"y_m\":{y},\"heading_deg\":{deg}}}");
        assert_eq!(daemon.send("PUT", "/v1/pose", &body).status, 202);
        assert_eq!(daemon.get("/v1/pose").json()["x_m"].as_f64(), x.parse().ok());
        let scans = daemon.health()["scans"]["completed"].as_u64().expect("a count");
        daemon.wait_for_scans(scans + 2);
        assert_eq!(reported(&daemon), predicted(pose), "{pose}");
    }
    // Places where it can't be, and plans, are refused.
    for (path, body, word) in [
        ("/v1/pose", r#"{"x_m":99,"y_m":0,"heading_deg":0}"#, "outside"),
        ("/v1/pose", r#"{"x_m":5.55,"y_m":1.2,"heading_deg":0}"#, "ranger s"),
        ("/v1/plan", r#"{"from_deg":0,"to_deg":9,"step_deg":0.9,"pings_per_stop":1}"#, "fixed"),
    ] {
        let reply = daemon.send("PUT", path, body);
        assert_eq!(reply.status, 409, "{}", reply.json());
        assert!(
            reply.json()["error"].as_str().is_some_and(|e| e.contains(word)),
            "{}",
            reply.json()
        );
    }
    daemon.stop();
    clean_log(folder.path());
}

#[test]
fn deadband_of_subscribers() {
    const MAX_WINDOWS: usize = 1000;
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = in_process(folder.path(), &["--pose", "3,1.2,20"], &[]);
    daemon.wait_for_scans(1);
    let quiet = receive_for(&daemon, "/v1/live/records?moved_m=0.05", 2.0);
    assert_eq!(pings(&quiet).len(), 8, "each ranger once: the robot is stationary");
    let every = receive_for(&daemon, "/v1/live/records", 2.0);
    assert!(pings(&every).len() > 24, "{}", pings(&every).len());
    let mut subscriber = Subscriber::new(&daemon, "/v1/live/records?moved_m=0.05");
    assert_eq!(pings(&subscriber.receive_for(1.2)).len(), 8);
    let body = r#"{"x_m":3.3,"y_m":1.2,"heading_deg":20}"#;
    assert_eq!(daemon.send("PUT", "/v1/pose", body).status, 202);
    let moved = subscriber.receive_for(1.8);
    let count = pings(&moved).len();
    assert!((1..=8).contains(&count), "{count}: what the move changed, once");
    // A whole round is a message, too.
    let mut subscriber = Subscriber::new(&daemon, "/v1/live/scans");
    let mut rounds = Vec::new();
    for _ in 0..MAX_WINDOWS {
        // The clock of the daemon does not pass more slowly on a busy computer: a client may miss
        // rounds, which a line replaces.
        let received = subscriber.receive_for(0.5).into_iter();
        rounds.extend(received.filter(|line| line["type"] != "dropped"));
        if rounds.len() >= 2 {
            break;
        }
    }
    for scan in &rounds {
        assert_eq!(scan["pings"].as_array().map(Vec::len), Some(8), "{scan}");
    }
    assert!(rounds.len() >= 2, "{}", rounds.len());
    daemon.stop();
}

#[test]
fn watch_prints_simulated_readings() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start_stationary(folder.path(), &[]);
    let socket = folder.path().join("s").display().to_string();
    let mut watch = sonard(&["watch", "--socket", &socket]);
    let mut child = watch.stdout(std::process::Stdio::piped()).spawn().expect("starts");
    let mut lines = BufReader::new(child.stdout.take().expect("piped")).lines();
    let line =
        lines.find_map(|line| line.ok().filter(|line| line.contains("deg"))).expect("a line");
    assert!(line.trim_start().starts_with('s') && line.ends_with("(simulated)"), "{line}");
    child.kill().expect("it runs");
    child.wait().expect("it ends");
    assert_eq!(daemon.stop(), Some(0));
}

#[test]
fn course_and_poses_in_the_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let course = folder.path().join("course.jsonl");
    let line = |time_s: f64, x_m: f64, y_m: f64, heading_deg: f64| {
        json!({"time_s": time_s, "x_m": x_m, "y_m": y_m, "heading_deg": heading_deg}).to_string()
            + "\n"
    };
    let text = line(0.0, 2.0, 1.2, 0.0) + &line(3.0, 3.2, 1.2, 0.0) + &line(5.0, 3.2, 1.2, 90.0);
    fs::write(&course, text).expect("writes");
    let setting = format!("simulate.course={}", course.display());
    let daemon = in_process(folder.path(), &[], &["--set", &setting]);
    daemon.wait_for_scans(1);
    assert_eq!(daemon.status()["simulation"]["driving"], true);
    daemon
        .wait_until("the end of the course", || daemon.status()["simulation"]["driving"] == false);
    let skipped = daemon.status()["simulation"]["skipped"].clone();
    let pose = daemon.get("/v1/pose").json();
    assert_eq!(pose, json!({"x_m": 3.2, "y_m": 1.2, "heading_deg": 90.0}));
    let scans = daemon.health()["scans"]["completed"].as_u64().expect("a count");
    daemon.wait_for_scans(scans + 2);
    assert_eq!(reported(&daemon), predicted("3.2,1.2,90"));
    daemon.stop();
    println!("{skipped} turns left out");

    let log = clean_log(folder.path());
    let moved = log.pings().iter().filter(|ping| ping["pose"].is_object()).count();
    assert!(moved > 50, "{moved} readings from another place than their scan's");
    // Predictions at the logged positions equal the readings: every logged position is right.
    let file = logs(folder.path())[0].display().to_string();
    let compared = run(&["compare", &file, "--scene", "mcgill-lab", "--json"]);
    let compared: Value = serde_json::from_slice(&compared.stdout).expect("one object");
    let beams = log.pings().len() as u64;
    assert_eq!(
        (compared["beams"].as_u64(), &compared["verdicts"]["unexplained"]),
        (Some(beams), &json!(0))
    );
    assert!(compared["p90_abs_residual_m"].as_f64().is_some_and(|m| m < 1e-9), "{compared}");
}

#[test]
fn requested_rounds() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon =
        in_process(folder.path(), &["--pose", "3,1.2,20"], &["--set", "scanning.mode=on-request"]);
    daemon.wait_for("ready");
    daemon.pass(Duration::from_millis(500));
    assert_eq!(daemon.get("/v1/scan/latest").status, 404, "nothing is played unasked");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":3}"#).status, 202);
    daemon.wait_for_scans(3);
    daemon.wait_for("ready");
    assert_eq!(daemon.health()["scans"]["beams"], 24);
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":100}"#).status, 202);
    daemon.wait_for_scans(4);
    assert_eq!(daemon.send("POST", "/v1/stop", "").status, 202);
    daemon.wait_for("ready");
    let scans = daemon.health()["scans"].clone();
    daemon.pass(Duration::from_millis(600));
    assert_eq!(daemon.health()["scans"], scans, "it stays stopped");
    daemon.stop();
    let log = clean_log(folder.path());
    assert!(log.events().iter().any(|event| event.contains("on request")), "{:?}", log.events());
}

#[test]
fn synced_records_survive_kill() {
    let folder = tempfile::tempdir().expect("a folder");
    let records = || -> u64 {
        let bytes = |log| fs::read(log).expect("readable");
        let lines = |log| bytes(log).iter().filter(|&&byte| byte == b'\n').count() as u64;
        logs(folder.path()).into_iter().map(lines).sum()
    };
    for turn in 0..4 {
        let before = if turn > 0 { records() } else { 0 };
        let daemon = start_stationary(
            folder.path(),
            &["--set", "log.sync_s=0.1", "--set", "log.daily=false"],
        );
        wait_until("records", || daemon.status()["log"]["synced"].as_u64() > Some(12));
        std::thread::sleep(Duration::from_millis(37 * turn));
        let synced = daemon.status()["log"]["synced"].as_u64().expect("a count");
        daemon.kill();
        assert!(records() >= before + synced, "{} of {before} and {synced}", records());
    }
    let daemon = start_stationary(folder.path(), &["--set", "log.daily=false"]);
    daemon.wait_for_scans(1);
    assert_eq!(daemon.stop(), Some(0));
    assert_eq!(logs(folder.path()).len(), 1, "the same log goes on");
    clean_log(folder.path());
}
