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
    let path = folder.path().join("way.jsonl");
    fs::write(&path, POSES.iter().map(line).collect::<String>()).expect("writes");
    path.to_str().expect("plain path").to_owned()
}

#[test]
fn a_course_is_the_scans_of_its_poses() {
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
fn a_pose_where_no_ranger_can_stand_is_named() {
    let folder = TempDir::new().expect("a temporary folder");
    let path = folder.path().join("way.jsonl");
    fs::write(&path, "{\"x_m\":0.4,\"y_m\":0.3}\n{\"x_m\":9,\"y_m\":0.3}\n").expect("writes");
    let path = path.to_str().expect("plain path");
    let output = run(&["simulate", "--scene", "simple-room", "--poses", path]);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
    let said = stderr(&output);
    assert!(said.contains("way.jsonl: pose 2: ") && said.contains("outside"), "{said}");
}
