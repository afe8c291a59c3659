//! `sonard simulate --poses`: a course of scans by one turning ranger.

use std::fs;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{run, stderr};

const POSES: [&str; 2] = ["0.774,0.085,270", "0.5,0.2,260"];

/// Runs with an arc of ten beams and gives the records.
fn simulated(scene: &str, place: [&str; 2]) -> Vec<Value> {
    let arc = ["--from-deg", "0", "--to-deg", "8.1"];
    let output = run(&[&["simulate", "--scene", scene], &place[..], &arc].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let lines = String::from_utf8(output.stdout).expect("text");
    lines.lines().map(|line| serde_json::from_str(line).expect("a record")).collect()
}

fn of_type<'a>(records: &'a [Value], kind: &str) -> Vec<&'a Value> {
    records.iter().filter(|record| record["type"] == kind).collect()
}

fn way(folder: &TempDir) -> String {
    let line = |pose: &&str| {
        let part: Vec<&str> = pose.split(',').collect();
        format!("{{\"x_m\":{},\"y_m\":{},\"heading_deg\":{}}}\n", part[0], part[1], part[2])
    };
    let path = folder.path().join("trajectory.jsonl");
    fs::write(&path, POSES.iter().map(line).collect::<String>()).expect("writes");
    path.to_str().expect("plain path").to_owned()
}

#[test]
fn one_scan_per_pose() {
    let folder = TempDir::new().expect("a temporary folder");
    let way = way(&folder);
    // A robot's body is elsewhere at each pose, and with it the scene that a session names.
    for (scene, sessions) in [("simple-room", 1), ("simple-room-robot", 2)] {
        let course = simulated(scene, ["--poses", &way]);
        assert_eq!(of_type(&course, "session").len(), sessions, "{scene}");
        assert_eq!(of_type(&course, "scan_end").len(), 2, "{scene}");
        let read = |ping: &&Value| (ping["status"].clone(), ping["range_m"].clone());
        let along: Vec<_> = of_type(&course, "ping").iter().map(read).collect();
        let alone: Vec<_> = POSES
            .iter()
            .flat_map(|pose| {
                let records = simulated(scene, ["--pose", pose]);
                of_type(&records, "ping").iter().map(read).collect::<Vec<_>>()
            })
            .collect();
        assert_eq!(along, alone, "{scene}");
    }
}

#[test]
fn invalid_poses_are_skipped() {
    let folder = TempDir::new().expect("a temporary folder");
    let path = folder.path().join("trajectory.jsonl");
    let lines = "{\"x_m\":0.4,\"y_m\":0.3}\n{\"x_m\":9,\"y_m\":0.3}\n{\"x_m\":\"a\"}\n\
                 {\"x_m\":0.5,\"y_m\":0.3}\n";
    fs::write(&path, lines).expect("writes");
    let path = path.to_str().expect("plain path");
    let output = run(&["simulate", "--scene", "simple-room", "--poses", path]);
    let printed = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{printed}");
    assert_eq!(String::from_utf8_lossy(&output.stdout).matches("scan_end").count(), 2);
    for part in
        ["trajectory.jsonl:2: ", "outside", "trajectory.jsonl:3: ", "x_m is", "2 of 4 poses"]
    {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    // With none left there is nothing to do.
    fs::write(folder.path().join("none.csv"), "x_m,y_m,heading_deg\n9,9,0\n").expect("writes");
    let none = folder.path().join("none.csv");
    let none = none.to_str().expect("plain path");
    let output = run(&["simulate", "--scene", "simple-room", "--poses", none]);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
    let printed = stderr(&output);
    assert!(printed.contains("none.csv:2: ") && printed.contains("outside"), "{printed}");
}

#[test]
fn file_formats_of_collections() {
    let folder = TempDir::new().expect("a temporary folder");
    let path = folder.path().join("poses.csv");
    fs::write(&path, "name,x_m,y_m,heading_deg,door\na,0.4,0.3,90,open\nb,0.5,0.2,-5,shut\n")
        .expect("writes");
    let path = path.to_str().expect("plain path");
    let records = simulated("simple-room", ["--poses", path]);
    let headings: Vec<_> = of_type(&records, "scan_start")
        .iter()
        .map(|start| start["pose"]["heading_deg"].as_f64().expect("a heading"))
        .collect();
    assert_eq!(headings, [90.0, -5.0]);
    let plan = folder.path().join("plan.toml");
    let text = format!("[place]\nscene = \"simple-room\"\n[poses]\nfile = \"{path}\"\n");
    fs::write(&plan, text).expect("writes");
    let checked = run(&["collect", plan.to_str().expect("plain path"), "--check"]);
    assert!(checked.status.success(), "{}", stderr(&checked));
}
