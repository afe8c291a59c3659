//! The API's answers, held against its document.

mod clients;
mod orders;

use std::{
    fs,
    io::{BufRead as _, BufReader, Write as _},
    time::Duration,
};

use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Value, json};
use sonard::{
    acoustics::Sensor,
    api::{
        AirStatus, Beam, FloorPlan, Health, InForce, ListedScan, LogEntry, ScanReport, Scanning,
        SensorFigures, Setup, Started, Status, WholeScan,
    },
    geometry::Pose,
    scan::{ScanPlan, Session},
    server::Peer,
};
use sonard_test_support::in_process::Daemon as InProcess;

use super::{Daemon, clean_log, logs, schema::misfits, send_request};
use crate::common::{run, stderr, wait_until};

/// A scan of a quarter turn that takes a second.
const SHORT: [&str; 6] =
    ["--set", "plan.to_deg=36", "--set", "model.max_range_m=3", "--set", "plan.step_deg=1.8"];

#[test]
fn responses_match_the_openapi() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["index.html", "playground.js"] {
        fs::write(folder.path().join(name), "a page").expect("there is room");
    }
    let playground = format!("server.playground={}", folder.path().display());
    let others = ["--set", "fleet.daemons=/nowhere/at/all"];
    let further = [&SHORT[..], &["--set", &playground], &others].concat();
    let daemon = InProcess::start_mock(folder.path(), &further);
    let document = daemon.get("/v1/openapi.json").json();
    assert_eq!(document["openapi"], "3.1.0");
    daemon.wait_for("ready");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    let log = daemon.get("/v1/logs").json()[0]["name"].as_str().expect("a log").to_owned();
    let latest = daemon.get("/v1/scan/latest").json();
    let scan = latest["start"]["scan"].as_str().expect("an id").to_owned();
    let requested = daemon.send("POST", "/v1/start", r#"{"scans":20}"#).json();
    let bodies = [
        ("/v1/start", json!({"scans": 1})),
        ("/v1/cancel", json!({"request": requested["request"]})),
        ("/v1/scanning", json!({"mode": "on-request"})),
        ("/v1/stop", json!({})),
        ("/v1/plan", json!({"from_deg": 0.0, "to_deg": 9.0, "step_deg": 0.9, "pings_per_stop": 1})),
        ("/v1/pose", json!({"x_m": 0.5, "y_m": 0.3, "heading_deg": 0.0})),
        ("/v1/air", json!({"temperature_c": 22.5})),
        ("/v1/settings", json!({"air": {"temperature_c": 22.0}})),
        ("/v1/preview", json!({"sensor": {"preset": "polaroid-chirp"}})),
        ("/v1/sensor", json!({"threshold": 0.03, "gain": {"kind": "compensating"}})),
    ];
    let bodies = [&bodies[..], &[("/v1/survey", surveyable())]].concat();
    let mut operations = 0;
    for (path, methods) in document["paths"].as_object().expect("paths") {
        for (method, operation) in methods.as_object().expect("methods") {
            operations += 1;
            let body = bodies.iter().find(|(of, _)| of == path).map(|(_, body)| body);
            let takes = &operation["requestBody"]["content"]["application/json"]["schema"];
            if let (Some(body), false) = (body, takes.is_null() || method == "get") {
                assert_eq!(misfits(takes, &document, body), Vec::<String>::new(), "{path}");
            }
            let content =
                |status: u16| operation["responses"][status.to_string()]["content"].clone();
            if path.starts_with("/v1/live/") {
                check_stream(&daemon, path, &content(200), &document);
                continue;
            }
            let path = path
                .replace("{name}", &log)
                .replace("playground/{file}", "playground/playground.js")
                .replace("{file}", "main.js")
                .replace("{scan}", &scan)
                .replace("{index}", "7");
            let text = if method == "get" {
                String::new()
            } else {
                body.map_or_else(String::new, Value::to_string)
            };
            // Through the server: a WebSocket needs a connection.
            let headers = [("Host", "localhost"), ("Content-Type", "application/json")];
            let (method, connection) = (method.to_ascii_uppercase(), daemon.connect());
            let reply = send_request(connection, &method, &path, &headers, &text);
            let content = content(reply.status);
            assert!(
                content.is_object(),
                "{method} {path}: {} is not in the document",
                reply.status
            );
            let mut kinds = content.as_object().expect("content").iter();
            let has_text = |media: &str| reply.head.contains(&format!("content-type: {media}"));
            let (media, schema) = kinds
                .find(|(media, _)| has_text(media))
                .unwrap_or_else(|| panic!("{path}: {}", reply.head));
            let values: Vec<Value> = match media.as_str() {
                "application/json" => vec![reply.json()],
                "application/x-ndjson" if path == "/v1/survey" => std::str::from_utf8(&reply.body)
                    .expect("text")
                    .lines()
                    .map(|line| serde_json::from_str(line).expect("JSON"))
                    .collect(),
                _ => Vec::new(),
            };
            for value in values {
                let faults = misfits(&schema["schema"], &document, &value);
                assert_eq!(faults, Vec::<String>::new(), "{method} {path}");
            }
        }
    }
    assert!(operations >= 25, "{operations} operations");
    // What only looks like a log is none, and breaks no list.
    let folder_like_a_log = folder.path().join("log/sonard-20260101T000000Z.jsonl");
    fs::create_dir(folder_like_a_log).expect("it is new");
    let names = daemon.get("/v1/logs").json();
    assert_eq!(names.as_array().map(Vec::len), Some(1), "{names}");
    assert_eq!(daemon.get("/v1/scans").status, 200);
    let figures = String::from_utf8(daemon.get("/metrics").body).expect("text");
    assert!(figures.contains("\nsonard_simulated 1"), "a mock measures nothing: {figures}");
    daemon.stop();
}

#[test]
fn rejections_match_the_openapi() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &SHORT);
    let document = daemon.get("/v1/openapi.json").json();
    daemon.wait_for("ready");
    for (method, path, body, status) in [
        ("GET", "/v1/nothing", "", 404),
        ("GET", "/v1/logs/..%2F..%2Fetc%2Fpasswd", "", 404),
        ("DELETE", "/v1/plan", "", 405),
        ("PUT", "/v1/plan", "{", 400),
        ("PUT", "/v1/plan", "{}", 422),
        (
            "PUT",
            "/v1/plan",
            r#"{"from_deg":0,"to_deg":9,"step_deg":0.9,"pings_per_stop":1,"pings":2}"#,
            422,
        ),
        ("PUT", "/v1/pose", r#"{"x_m":0.5,"y_m":0.3,"heading_deg":0,"z_m":1}"#, 422),
        ("POST", "/v1/start", r#"{"pose":{"x_m":0.5,"y_m":0.3,"heading_deg":0,"z_m":1}}"#, 422),
        ("POST", "/v1/start", r#"{"scans":1,"scans":2}"#, 422),
        ("GET", "/v1/logs/sonard-20260101T000000Z.jsonl", "", 404),
        ("PUT", "/v1/pose", r#"{"x_m":99,"y_m":0,"heading_deg":0}"#, 409),
        ("PUT", "/v1/pose", "[0.5,0.3,0]", 422),
        ("POST", "/v1/start", "[null,null]", 422),
        ("POST", "/v1/start", r#"{"plan":[0,9,0.9,1]}"#, 422),
        ("PUT", "/v1/air", r#"{"temperature_c":70}"#, 422),
        ("PUT", "/v1/sensor", r#"{"preset":"ear"}"#, 422),
        ("PUT", "/v1/sensor", r#"{"threshold":[0.1]}"#, 422),
        ("PUT", "/v1/sensor", r#"["senscomp-6500"]"#, 422),
        ("POST", "/v1/start", r#"{"scnas":1}"#, 422),
        ("GET", "/v1/live/records?moved_m=-1", "", 422),
        ("GET", "/v1/live/records?mvoed_m=1", "", 400),
        ("GET", "/v1/live/records?verdicts=1", "", 400),
        ("GET", "/v1/scans?limit=0", "", 422),
        ("GET", "/v1/scans?limit=many", "", 400),
        ("GET", "/v1/scans/latest", "", 404),
        ("GET", "/v1/scans/00000000-0000-4000-8000-000000000000", "", 404),
        ("GET", "/page/..%2Findex.html", "", 404),
        ("GET", "/page/nothing.js", "", 404),
    ] {
        let reply = daemon.send(method, path, body);
        assert_eq!(reply.status, status, "{method} {path}: {}", reply.json());
        let problem = &document["paths"]["/v1/plan"]["get"]["responses"]["default"]["content"];
        let faults = misfits(&problem["application/json"]["schema"], &document, &reply.json());
        assert_eq!(faults, Vec::<String>::new(), "{method} {path}");
    }
    daemon.stop();
}

/// Answers deserialize into the client's types without loss.
#[test]
fn responses_deserialize() {
    fn same<T: Serialize + DeserializeOwned>(path: &str, answer: &Value) {
        let read: T = serde_json::from_value(answer.clone())
            .unwrap_or_else(|error| panic!("{path}: {error}"));
        // As text, where a number of single precision has no more digits than it needs.
        let written = serde_json::to_string(&read).expect("JSON");
        assert_eq!(serde_json::from_str::<Value>(&written).expect("JSON"), *answer, "{path}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &SHORT);
    daemon.wait_for("ready");
    same::<Started>("/v1/start", &daemon.send("POST", "/v1/start", r#"{"scans":1}"#).json());
    daemon.wait_for_scans(1);
    let requested = daemon.send("POST", "/v1/start", r#"{"scans":2}"#);
    assert_eq!(requested.status, 202);
    assert_eq!(daemon.send("PUT", "/v1/air", r#"{"temperature_c":22.5}"#).status, 202);
    let scan = daemon.get("/v1/scan/latest").json()["start"]["scan"].clone();
    let scan = format!("/v1/scans/{}", scan.as_str().expect("an id"));
    let check = |path: &str, of: fn(&str, &Value)| of(path, &daemon.get(path).json());
    check("/v1/status", same::<Status>);
    check("/v1/health", same::<Health>);
    check("/v1/scan/latest", same::<ScanReport>);
    check("/v1/session", same::<Session>);
    check("/v1/setup", same::<InForce<Setup>>);
    check("/v1/plan", same::<InForce<ScanPlan>>);
    check("/v1/pose", same::<InForce<Pose>>);
    check("/v1/air", same::<InForce<AirStatus>>);
    check("/v1/sensor", same::<InForce<SensorFigures>>);
    check("/v1/sensors", same::<Vec<Sensor>>);
    check("/v1/scanning", same::<Scanning>);
    check("/v1/scene", same::<FloorPlan>);
    check("/v1/scans", same::<Vec<ListedScan>>);
    check("/v1/logs", same::<Vec<LogEntry>>);
    check(&scan, same::<WholeScan>);
    check(&format!("{scan}/beams/7"), same::<Beam>);
    check(&format!("{scan}/scene"), same::<FloorPlan>);
    daemon.stop();
}

/// Two sweeps of perpendicular echoes in a rectangular room, with a budget that ends at once.
fn surveyable() -> Value {
    let sweep = |x_m: f64| {
        let walls_m = [2.8 - x_m, 1.5, x_m, 0.8];
        let azimuths_deg: Vec<f64> = (0..400).map(|beam| 0.9 * f64::from(beam)).collect();
        let range_m = |azimuth_deg: &f64| {
            let side = (azimuth_deg / 90.0).round();
            let is_near = (azimuth_deg - 90.0 * side).abs() < 8.0;
            is_near.then(|| walls_m[side as usize % 4])
        };
        let ranges_m: Vec<Option<f64>> = azimuths_deg.iter().map(range_m).collect();
        let pose = json!({"x_m": x_m, "y_m": 0.8, "heading_deg": 0.0});
        json!({"pose": pose, "azimuths_deg": azimuths_deg, "ranges_m": ranges_m})
    };
    json!({"sweeps": [sweep(1.0), sweep(1.4)], "max_scenes": 100})
}

/// Both forms of a stream follow the document.
fn check_stream(daemon: &InProcess, path: &str, content: &Value, document: &Value) {
    for (format, media, prefix) in
        [("ndjson", "application/x-ndjson", ""), ("sse", "text/event-stream", "data: ")]
    {
        let mut stream = daemon.connect();
        // A reading with its annotations is the record with most fields.
        let (verdicts, kind) = if path == "/v1/live/records" {
            ("&verdicts=true", json!("ping"))
        } else {
            ("", Value::Null)
        };
        let request =
            format!("GET {path}?format={format}{verdicts} HTTP/1.1\r\nHost: localhost\r\n\r\n");
        stream.write_all(request.as_bytes()).expect("it listens");
        let mut lines = BufReader::new(stream).lines().map(|line| line.expect("a line"));
        assert!(lines.any(|line| line.eq_ignore_ascii_case(&format!("content-type: {media}"))));
        assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
        let first = lines.find_map(|line| {
            let json = line.strip_prefix(prefix)?;
            let record = serde_json::from_str::<Value>(json).ok().filter(Value::is_object);
            record.filter(|record| record["type"] == kind)
        });
        let schema = &content[media]["schema"];
        assert!(schema.is_object(), "{media} is not in the document");
        let faults = misfits(schema, document, &first.expect("a record"));
        assert_eq!(faults, Vec::<String>::new(), "{path} {format}");
    }
}

#[test]
fn past_scans_and_beams() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &SHORT);
    daemon.wait_for("ready");
    assert_eq!(daemon.get("/v1/scans").json(), json!([]));
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":2}"#).status, 202);
    daemon.wait_for_scans(2);
    // The last scan can be read once it is in the log.
    daemon.wait_until("the log", || daemon.get("/v1/scan/latest").status == 200);
    let latest = daemon.get("/v1/scan/latest").json();
    let scans = daemon.get("/v1/scans?limit=1").json();
    assert_eq!(scans.as_array().map(Vec::len), Some(1));
    assert_eq!(scans[0]["scan"], latest["start"]["scan"]);
    assert_eq!((&scans[0]["provenance"], &scans[0]["end"]["beams"]), (&json!("mock"), &json!(20)));

    let id = scans[0]["scan"].as_str().expect("an id").to_owned();
    let whole = daemon.get(&format!("/v1/scans/{id}")).json();
    assert_eq!(whole["session"]["scene"]["name"], "simple-room");
    // The same readings as in memory, with their verdicts.
    let mut pings = whole["pings"].clone();
    for ping in pings.as_array_mut().expect("readings") {
        let azimuth_deg = ping["azimuth_deg"].clone();
        let fields = ping.as_object_mut().expect("an object");
        assert!(fields.remove("verdict").is_some_and(|verdict| verdict.is_string()));
        let viewpoint = fields.remove("viewpoint").expect("a viewpoint");
        assert_eq!((&viewpoint["x_m"], &viewpoint["y_m"]), (&json!(0.774), &json!(0.085)));
        assert_eq!(viewpoint["direction_deg"], azimuth_deg);
    }
    assert_eq!(pings, latest["pings"]);

    // In this room everything is explained: the path runs from the ranger round and back to it.
    let beam = daemon.get(&format!("/v1/scans/{id}/beams/5")).json();
    assert_eq!(beam["reading"], whole["pings"][5]);
    let path = beam["polyline"].as_array().expect("a path");
    assert_eq!((&path[0], path.last()), (&json!([0.774, 0.085]), Some(&path[0])));
    let length_m: f64 = path.windows(2).map(|leg| distance(&leg[0], &leg[1])).sum();
    let stated_m = whole["pings"][5]["sim"]["path"]["length_m"].as_f64().expect("a length");
    assert!((length_m - stated_m).abs() < 1e-6, "{length_m} and {stated_m}");
    let drawn = |peak: &Value| peak["path"] == whole["pings"][5]["sim"]["path"];
    let peaks = beam["peaks"].as_array().expect("peaks");
    assert!(
        peaks.iter().any(|peak| drawn(peak) && peak["polyline"] == beam["polyline"]),
        "{peaks:?}"
    );
    let echo = &beam["echoes"][0];
    let off_m = echo["range_m"].as_f64().zip(whole["pings"][5]["range_m"].as_f64());
    assert!(off_m.is_some_and(|(a, b)| (a - b).abs() < 1e-9), "{echo}");

    assert_eq!(daemon.get(&format!("/v1/scans/{id}/beams/20")).status, 404);
    assert_eq!(daemon.get(&format!("/v1/scans/{id}/beams/one")).status, 404);
    let scene = daemon.get("/v1/scene").json();
    assert_eq!(scene["sha256"], whole["session"]["scene"]["sha256"]);
    assert_eq!(scene["walls"].as_array().map(Vec::len), Some(4));
}

#[test]
fn log_byte_ranges() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &SHORT);
    daemon.wait_for("ready");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    daemon.wait_until("the log", || {
        let log = daemon.status()["log"].clone();
        log["synced"].as_u64() >= log["written"].as_u64()
    });
    let log = logs(folder.path()).remove(0);
    let path = format!("/v1/logs/{}", log.file_name().expect("a name").to_string_lossy());
    let whole = fs::read(&log).expect("readable");
    let get = |range: &str| {
        let headers = [("Range", range)];
        daemon.request(Peer::Unix, "GET", &path, &headers, "")
    };
    let reply = get("bytes=100-");
    assert_eq!((reply.status, &reply.body[..]), (206, &whole[100..]));
    let range = format!("content-range: bytes 100-{}/{}", whole.len() - 1, whole.len());
    assert!(reply.head.contains(&range), "{}", reply.head);
    // What need not be understood is answered with the whole.
    for other in
        ["bytes=-5", "bytes=0-1,3-4", "lines=1-", "bytes=x-", "bytes=99999999999999999999-"]
    {
        let reply = get(other);
        assert_eq!((reply.status, reply.body.len()), (200, whole.len()), "{other}");
    }
    assert_eq!(get(&format!("bytes={}-", whole.len())).status, 416);
}

/// Between two points of a floor plan, metres.
fn distance(one: &Value, other: &Value) -> f64 {
    let along = |axis: usize| one[axis].as_f64().zip(other[axis].as_f64()).map(|(a, b)| a - b);
    along(0).zip(along(1)).map(|(x, y)| x.hypot(y)).expect("two points")
}
