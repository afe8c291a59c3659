//! Poses of logged scans, located by a daemon.

use std::{
    fs,
    io::{Read as _, Write as _},
    path::{Path, PathBuf},
};

use serde_json::{Value, json};
use sonard::api::Location;
use sonard_test_support::in_process::Daemon as InProcess;

use super::{Daemon, Reply};
use crate::common::{run, stderr};

/// A room whose ends look alike turned by half, with a short wall near its middle that does not.
const ROOM: &str = r#"{"name": "long room", "materials": {"plaster": {"reflectance": 0.95}}, "walls": [
    {"id": "w", "polyline": [[0, 0], [5, 0], [5, 1], [0, 1]], "closed": true, "material": "plaster"},
    {"id": "stub", "from": [2.9, 1], "to": [2.9, 0.6], "material": "plaster"}]}"#;
const WAY: &str = "2.2,0.4,5\n3.4,0.35,30\n4.4,0.6,80\n";

/// Scene so large and full of pillars that a search takes minutes.
fn hall() -> String {
    let pillar = |at: u32| {
        let [x_m, y_m] = [at % 8, at / 8].map(|place| 1.5 + 2.2 * f64::from(place));
        json!({"id": format!("p{at}"), "center": [x_m, y_m], "radius_m": 0.15, "material": "plaster"})
    };
    let corners = [[0, 0], [19, 0], [19, 18], [7, 21], [0, 20]];
    let walls = json!([{"id": "w", "polyline": corners, "closed": true, "material": "plaster"}]);
    let (pillars, plaster) =
        ((0..56).map(pillar).collect::<Vec<_>>(), json!({"reflectance": 0.95}));
    json!({"name": "hall", "materials": {"plaster": plaster}, "walls": walls, "cylinders": pillars})
        .to_string()
}

/// A log of a day in a daemon's folder, with a scan from each pose.
pub(super) fn simulated(
    folder: &Path,
    day: u32,
    scene: &str,
    way: &str,
    further: &[&str],
) -> PathBuf {
    let logs = folder.join("log");
    fs::create_dir_all(&logs).expect("room on the disk");
    let log = logs.join(format!("sonard-2026010{day}T000000Z.jsonl"));
    let [scene_file, way_file] = ["scene.json", "trajectory.csv"].map(|name| folder.join(name));
    fs::write(&scene_file, scene).expect("room on the disk");
    fs::write(&way_file, format!("x_m,y_m,heading_deg\n{way}")).expect("room on the disk");
    let [scene_file, way_file, out] =
        [&scene_file, &way_file, &log].map(|path| path.to_str().expect("a plain path"));
    let simulate = ["simulate", "--scene", scene_file, "--poses", way_file, "-o", out];
    let output = run(&[&simulate[..], further].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    log
}

/// Returns the output of `sonard locate --json` for a log.
fn located(log: &Path, further: &[&str]) -> Vec<Value> {
    let locate = ["locate", log.to_str().expect("a plain path"), "--json"];
    let output = run(&[&locate[..], further].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

/// Returns `true` if the poses of a location are those that the program lists for its scan.
fn assert_same(location: &Location, listed: &[Value]) {
    assert_eq!(location.unavailable_reason, None);
    let scan = location.scan.to_string();
    let listed: Vec<&Value> = listed.iter().filter(|line| line["scan"] == *scan).collect();
    assert_eq!(location.poses.len(), listed.len(), "{location:?}");
    for (pose, listed) in location.poses.iter().zip(listed) {
        let pose = serde_json::to_value(pose).expect("JSON");
        for (name, value) in pose.as_object().expect("an object") {
            assert_eq!(*value, listed[name], "{name} of {scan}");
        }
    }
}

/// The scans of a daemon's logs, oldest first.
fn scans(list: &Reply) -> Vec<String> {
    let scans = list.json();
    let of = |scan: &Value| scan["scan"].as_str().expect("an id").to_owned();
    scans.as_array().expect("a list").iter().rev().map(of).collect()
}

#[test]
fn locates_as_the_command_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = simulated(folder.path(), 1, ROOM, WAY, &["--step-deg", "4", "--max-range", "1.5"]);
    let daemon = InProcess::start_mock(folder.path(), &["--set", "scanning.mode=on-request"]);
    let scans = scans(&daemon.get("/v1/scans?limit=500"));
    assert_eq!(scans.len(), 3);
    let alone = located(&log, &[]);
    let last = daemon.get(&format!("/v1/scans/{}/location", scans[2]));
    assert!(last.head.contains("content-type: application/json"), "{}", last.head);
    let last: Location = serde_json::from_value(last.json()).expect("a location");
    assert_eq!(last.poses.len(), 2, "both ends look alike");
    assert_same(&last, &alone);
    let course = |query: &str| {
        let reply = daemon.get(&format!("/v1/scans/{}/course{query}", scans[0]));
        assert!(reply.head.contains("content-type: application/x-ndjson"), "{}", reply.head);
        let text = String::from_utf8(reply.body).expect("text");
        let lines = text.lines().map(|line| serde_json::from_str(line).expect("a location"));
        lines.collect::<Vec<Location>>()
    };
    let way = course("");
    assert_eq!(way.iter().map(|of| of.scan.to_string()).collect::<Vec<_>>(), scans);
    let listed = located(&log, &["--course"]);
    way.iter().for_each(|location| assert_same(location, &listed));
    assert!(way[2].poses[0].probability > 0.99, "{:?}", way[2]);
    // If the robot may have been carried, the course does not constrain the pose.
    let carried = course(&format!("?kidnap_probability=1&to={}", scans[1]));
    assert_eq!(carried.len(), 2);
    assert_same(&carried[1], &located(&log, &["--course", "--kidnap-probability", "1"]));
    let absent = "00000000-0000-4000-8000-000000000000";
    for (path, status) in [
        (format!("{absent}/location"), 404),
        (format!("{absent}/course"), 404),
        ("latest/course".to_owned(), 404),
        (format!("{}/course?to={absent}", scans[0]), 404),
        (format!("{}/course?to={}", scans[1], scans[0]), 404),
        (format!("{}/course?kidnap_probability=1.5", scans[0]), 422),
        (format!("{}/course?drift_m_per_m=-1", scans[0]), 422),
        (format!("{}/course?drift=1", scans[0]), 400),
    ] {
        assert_eq!(daemon.get(&format!("/v1/scans/{path}")).status, status, "{path}");
    }
}

#[test]
fn reasons_without_location() {
    let folder = tempfile::tempdir().expect("a folder");
    let short = ["--step-deg", "90", "--max-range", "1.5"];
    simulated(folder.path(), 1, ROOM, "2.2,0.4,5\n", &short);
    let daemon = InProcess::start_mock(folder.path(), &["--set", "scanning.mode=on-request"]);
    let scan = &scans(&daemon.get("/v1/scans?limit=500"))[0];
    let refused = daemon.get(&format!("/v1/scans/{scan}/location"));
    assert_eq!(refused.status, 409);
    assert!(refused.json()["error"].as_str().expect("words").contains("at least 8"));
    let course = daemon.get(&format!("/v1/scans/{scan}/course"));
    assert_eq!(course.status, 200);
    let location: Location = serde_json::from_value(course.json()).expect("a location");
    assert!(
        location.poses.is_empty()
            && location.unavailable_reason.expect("words").contains("at least 8")
    );
}

#[test]
fn one_client_at_a_time() {
    let folder = tempfile::tempdir().expect("a folder");
    simulated(folder.path(), 1, &hall(), "4.8,9.3,0\n", &["--step-deg", "9"]);
    simulated(folder.path(), 2, ROOM, "2.2,0.4,5\n", &["--step-deg", "9", "--max-range", "1.5"]);
    let daemon = Daemon::start_mock(folder.path(), &["--set", "scanning.mode=on-request"]);
    let scans = scans(&daemon.get("/v1/scans?limit=500"));
    let [hall, room] = [&scans[0], &scans[1]].map(|scan| format!("/v1/scans/{scan}/location"));
    let mut first = daemon.connect().expect("it listens");
    write!(first, "GET {hall} HTTP/1.1\r\nHost: localhost\r\n\r\n").expect("it listens");
    let mut head = [0; 12];
    first.read_exact(&mut head).expect("an answer begins");
    assert_eq!(&head, b"HTTP/1.1 200");
    let second = daemon.get(&room);
    assert_eq!(second.status, 503, "{}", second.json());
    assert!(second.json()["help"].as_str().expect("words").contains("later"));
    // Everything else goes on meanwhile.
    assert_eq!(daemon.get("/v1/status").status, 200);
    drop(first);
    let second = daemon.send_when_free("GET", &room, "");
    assert_eq!(second.status, 200, "{}", String::from_utf8_lossy(&second.body));
    let found: Location = serde_json::from_value(second.json()).expect("a location");
    assert!((found.poses[0].x_m - 2.2).abs() < 0.02, "{found:?}");
}
