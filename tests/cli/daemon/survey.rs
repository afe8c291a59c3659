//! Unknown rooms, surveyed by a daemon.

use std::{
    fs,
    io::{Read as _, Write as _},
    path::Path,
};

use serde_json::{Value, json};
use sonard::api::{SurveyEvent, SurveyReport};
use sonard_test_support::in_process::Daemon as InProcess;

use super::{Daemon, Reply, location::simulated};
use crate::common::{run, stderr};

const ROOM: &str = r#"{"name": "room", "materials": {"plaster": {"reflectance": 0.97}}, "walls": [
    {"id": "w", "polyline": [[0, 0], [2.8, 0], [2.8, 2.3], [0, 2.3]], "closed": true, "material": "plaster"}]}"#;
const STOPS: &str = "0.7,0.6,20\n1.2,0.9,65\n1.9,1.3,100\n";
/// Room with boxes, whose survey takes minutes.
const FURNISHED: &str = r#"{"name": "office", "materials": {"plaster": {"reflectance": 0.97}}, "walls": [
    {"id": "w", "polyline": [[0, 0], [6, 0], [6, 2.5], [4.5, 2.5], [4.5, 5], [0, 5]], "closed": true, "material": "plaster"},
    {"id": "a", "polyline": [[2, 2], [2.7, 2.2], [2.5, 3]], "closed": true, "material": "plaster"},
    {"id": "b", "polyline": [[0.8, 3.5], [1.2, 3.4], [1.3, 4], [0.9, 4.1]], "closed": true, "material": "plaster"}]}"#;
const LONG_WAY: &str = "0.5,0.6,0\n1.3,0.8,10\n2.2,1,30\n3.3,1.2,60\n3.6,2.4,90\n3.5,3.6,120\n";

/// The scans of a daemon's logs, oldest first.
fn scans(list: &Reply) -> Vec<Value> {
    let list = list.json();
    list.as_array().expect("a list").iter().rev().map(|scan| scan["scan"].clone()).collect()
}

/// Lines of a response.
fn events(reply: &Reply) -> Vec<SurveyEvent> {
    let text = std::str::from_utf8(&reply.body).expect("text");
    assert_eq!(reply.status, 200, "{text}");
    assert!(reply.head.contains("content-type: application/x-ndjson"), "{}", reply.head);
    text.lines().map(|line| serde_json::from_str(line).expect("an event")).collect()
}

fn result(reply: &Reply) -> SurveyReport {
    match events(reply).pop() {
        Some(SurveyEvent::Result(report)) => *report,
        other => panic!("no result: {other:?}"),
    }
}

#[test]
fn surveys_as_the_command_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = simulated(folder.path(), 1, ROOM, STOPS, &["--max-range", "4"]);
    let daemon = InProcess::start_mock(folder.path(), &["--set", "scanning.mode=on-request"]);
    let scans = scans(&daemon.get("/v1/scans?limit=500"));
    assert_eq!(scans.len(), 3);
    let request = json!({"scans": scans, "max_range_m": 4}).to_string();
    let reply = daemon.send("POST", "/v1/survey", &request);
    let stages = events(&reply);
    let Some(SurveyEvent::Progress(first)) = stages.first() else { panic!("{stages:?}") };
    assert_eq!((first.scored_scenes, first.walls), (0, 0));
    let found = result(&reply);

    let out = folder.path().join("out");
    let [log, out] = [&log, &out].map(|path| path.to_str().expect("a plain path"));
    let survey = run(&["survey", log, "--max-range", "4", "--out", out, "--json"]);
    assert_eq!(survey.status.code(), Some(0), "{}", stderr(&survey));
    let listed: Value = serde_json::from_slice(&survey.stdout).expect("JSON");
    assert_eq!(serde_json::to_value(&found.survey).expect("JSON"), listed);
    let scene = fs::read_to_string(Path::new(out).join("scene.json")).expect("a scene");
    let scene: Value = serde_json::from_str(&scene).expect("JSON");
    assert_eq!(found.scene, Some(scene));
    assert_eq!(found.floor_plan.expect("a plan").walls.len(), 4);

    // Numbers of the ranger are fitted on request.
    let with_fit = |fit: &str| {
        let request = json!({"scans": scans, "max_range_m": 4, "fit": [fit]}).to_string();
        daemon.send("POST", "/v1/survey", &request)
    };
    let fitted = result(&with_fit("threshold")).survey.fitted.expect("a fit");
    let of = &fitted.numbers[0];
    assert!(of.is_determined && (of.value - of.assumed).abs() < 0.3, "{of:?}");
    let rejected = with_fit("walls");
    assert_eq!(rejected.status, 422);
    let error = rejected.json()["error"].to_string();
    assert!(error.contains("walls can't be fitted by a survey"), "{error}");

    // Uploaded, the same readings give the same walls.
    let sweeps = scans.iter().map(|scan| {
        let path = format!("/v1/scans/{}", scan.as_str().expect("an id"));
        let whole = daemon.get(&path).json();
        let pings = whole["pings"].as_array().expect("readings");
        let of = |name: &str| pings.iter().map(|ping| ping[name].clone()).collect::<Vec<_>>();
        json!({"pose": whole["start"]["pose"], "azimuths_deg": of("azimuth_deg"), "ranges_m": of("range_m")})
    });
    let request = json!({"sweeps": sweeps.collect::<Vec<_>>(), "max_range_m": 4}).to_string();
    let uploaded = result(&daemon.send("POST", "/v1/survey", &request)).survey;
    assert_eq!(uploaded.walls.len(), 4);
    for (uploaded, logged) in uploaded.walls.iter().zip(&found.survey.walls) {
        for (a, b) in uploaded.from.at_m.iter().zip(&logged.from.at_m) {
            assert!((a - b).abs() < 0.001, "{uploaded:?} {logged:?}");
        }
    }
}

#[test]
fn rejected_surveys() {
    let folder = tempfile::tempdir().expect("a folder");
    simulated(folder.path(), 1, ROOM, STOPS, &["--max-range", "4", "--step-deg", "3.6"]);
    let daemon = InProcess::start_mock(folder.path(), &["--set", "scanning.mode=on-request"]);
    let scans = scans(&daemon.get("/v1/scans?limit=500"));
    let absent = "00000000-0000-4000-8000-000000000000";
    let sweep = |azimuths: usize, range_m: f64| {
        let azimuths_deg: Vec<usize> = (0..azimuths).collect();
        json!({"pose": {"x_m": 0, "y_m": 0, "heading_deg": 0}, "azimuths_deg": azimuths_deg, "ranges_m": vec![range_m; 9]})
    };
    for (request, status, words, field) in [
        (json!({}), 422, "0 scans", Some("scans")),
        (json!({"scans": scans[..1]}), 422, "too few sweeps (1)", None),
        (json!({"sweeps": [sweep(9, 1.0)]}), 422, "1 sweeps", Some("sweeps")),
        (
            json!({"scans": scans, "round_spacing_m": -1}),
            422,
            "round_spacing_m is -1",
            Some("round_spacing_m"),
        ),
        (json!({"scans": vec![scans[0].clone(); 41]}), 422, "41 scans", Some("scans")),
        (json!({"scans": scans, "sweeps": [sweep(9, 1.0)]}), 422, "both given", Some("sweeps")),
        (json!({"scans": [scans[0], absent]}), 404, "unknown scan", None),
        (json!({"scans": scans, "max_scenes": 0}), 422, "max_scenes is 0", Some("max_scenes")),
        (json!({"scans": scans, "reflectance": 1.5}), 422, "reflectance is 1.5", None),
        (json!({"scans": scans, "max_range_m": 30}), 422, "max_range_m is 30", None),
        (json!({"scans": scans, "max_range_m": 0.3}), 409, "no arc of equal ranges", None),
        (
            json!({"scans": scans, "odometry": {"m_per_m": 0, "deg_per_m": 5}}),
            422,
            "m_per_m is 0",
            None,
        ),
        (json!({"scans": scans, "odd": 1}), 422, "unknown field `odd`", None),
        (
            json!({"sweeps": [sweep(9, 1.0), sweep(8, 1.0)]}),
            422,
            "9 ranges, but 8 azimuths",
            Some("sweeps[1].ranges_m"),
        ),
        (
            json!({"sweeps": [sweep(9, 1.0), sweep(9, -1.0)]}),
            422,
            "a range is -1",
            Some("sweeps[1].ranges_m"),
        ),
    ] {
        let reply = daemon.send("POST", "/v1/survey", &request.to_string());
        let problem = reply.json();
        assert_eq!(reply.status, status, "{request}: {problem}");
        assert!(problem["error"].as_str().expect("words").contains(words), "{request}: {problem}");
        assert_eq!(problem["field"].as_str(), field, "{request}: {problem}");
    }
    let idle = daemon.send("DELETE", "/v1/survey", "");
    assert_eq!(idle.status, 409, "{}", idle.json());
    assert_eq!(idle.json()["error"], "no survey is running");
}

#[test]
fn array_is_surveyed_as_by_the_command() {
    let folder = tempfile::tempdir().expect("a folder");
    let along = (0..7).map(|at| format!("{},0.7,0\n", 0.6 + 0.2 * f64::from(at)));
    let up = (0..6).map(|at| format!("1.9,{},90\n", 0.7 + 0.15 * f64::from(at)));
    let way: String = along.chain(up).collect();
    let ring = ["--array", "ring-12", "--max-range", "4"];
    let log = simulated(folder.path(), 1, ROOM, &way, &ring);
    let daemon = InProcess::start_mock(folder.path(), &["--set", "scanning.mode=on-request"]);
    let scans = scans(&daemon.get("/v1/scans?limit=500"));
    let request = json!({"scans": scans, "max_range_m": 4, "round_spacing_m": 0.3}).to_string();
    let found = result(&daemon.send("POST", "/v1/survey", &request)).survey;
    assert_eq!((found.walls.len(), found.poses.len()), (4, 7));

    let out = folder.path().join("out");
    let [log, out] = [&log, &out].map(|path| path.to_str().expect("a plain path"));
    let arguments = ["survey", log, "--max-range", "4", "--round-spacing", "0.3", "--out", out];
    let survey = run(&[&arguments[..], &["--json"]].concat());
    assert_eq!(survey.status.code(), Some(0), "{}", stderr(&survey));
    let listed: Value = serde_json::from_slice(&survey.stdout).expect("JSON");
    assert_eq!(serde_json::to_value(&found).expect("JSON"), listed);

    // A stepper's scan among them is rejected.
    simulated(folder.path(), 2, ROOM, STOPS, &["--max-range", "4", "--step-deg", "3.6"]);
    let all = self::scans(&daemon.get("/v1/scans?limit=500"));
    let reply = daemon.send("POST", "/v1/survey", &json!({"scans": all}).to_string());
    assert_eq!(reply.status, 409);
    let error = reply.json()["error"].to_string();
    assert!(error.contains("scans of an array and of a ranger on a stepper"), "{error}");
}

#[test]
fn one_survey_at_a_time() {
    let folder = tempfile::tempdir().expect("a folder");
    simulated(folder.path(), 1, FURNISHED, LONG_WAY, &[]);
    let daemon = Daemon::start_mock(folder.path(), &["--set", "scanning.mode=on-request"]);
    let scans = scans(&daemon.get("/v1/scans?limit=500"));
    let request = json!({"scans": scans, "max_scenes": 100_000}).to_string();
    let begin = || {
        let mut client = daemon.connect().expect("it listens");
        let length = request.len();
        let head = "POST /v1/survey HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: application/json";
        write!(client, "{head}\r\nContent-Length: {length}\r\n\r\n{request}").expect("it listens");
        let mut head = [0; 12];
        client.read_exact(&mut head).expect("a response begins");
        assert_eq!(&head, b"HTTP/1.1 200");
        client
    };
    let mut first = begin();
    let second = daemon.send("POST", "/v1/survey", &request);
    assert_eq!(second.status, 503, "{}", second.json());
    assert_eq!(second.json()["error"], "a localization or survey of another client is running");
    // Everything else continues meanwhile.
    assert_eq!(daemon.get("/v1/status").status, 200);
    // A cancelled survey returns its best plan.
    assert_eq!(daemon.send("DELETE", "/v1/survey", "").status, 200);
    let mut rest = String::new();
    first.read_to_string(&mut rest).expect("a whole response");
    assert!(rest.contains(r#""end":"cancelled""#), "{rest}");
    // A client that disconnects ends its survey: the next one begins.
    drop(begin());
    let short = json!({"scans": scans, "max_scenes": 1}).to_string();
    let third = result(&daemon.send_when_free("POST", "/v1/survey", &short));
    assert_eq!(third.survey.poses.len(), 6);
}
