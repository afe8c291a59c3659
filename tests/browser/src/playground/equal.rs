//! The page's readings equal the program's.

use std::{fmt::Write as _, fs};

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use sonard::{
    geometry::Pose,
    scene::{Scene, shipped},
};

use super::{eval_json, open};
use crate::live_page::browser::{Browser, DESK};
use sonard_test_support::{run, stderr};

/// Poses per scene; `SONARD_PLAYGROUND_POSES` sets another number.
const POSES: usize = 6;
const STEP_DEG: f64 = 7.2;
/// Beams per sweep.
const BEAMS: usize = 50;
const MAX_RANGE_M: f64 = 4.0;
const TOLERANCE_M: f64 = 1e-9;

#[test]
fn readings_equal_the_programs() {
    let browser = open(DESK);
    let requested = std::env::var("SONARD_PLAYGROUND_POSES").ok();
    let count = requested.and_then(|count| count.parse().ok()).unwrap_or(POSES);
    let folder = tempfile::tempdir().expect("a folder");
    let mut compared = 0;
    let mut max_m: f64 = 0.0;
    let mut different: Vec<String> = Vec::new();
    for (name, text) in shipped::SCENES {
        let poses = poses(&Scene::from_json(text).expect("shipped"), count);
        let course = folder.path().join("course.csv");
        let mut lines = String::from("x_m,y_m,heading_deg\n");
        for Pose { x_m, y_m, heading_deg } in &poses {
            writeln!(lines, "{x_m},{y_m},{heading_deg}").expect("a string");
        }
        fs::write(&course, lines).expect("there is room");
        for (engine, poses) in [("paths", &poses[..]), ("fan", &poses[..1]), ("cone", &poses[..1])]
        {
            let expected = program_readings(name, engine, &course.display().to_string());
            for (pose, expected) in poses.iter().zip(expected.chunks(BEAMS)) {
                let actual = page_readings(&browser, text, engine, pose);
                assert_eq!(actual.len(), expected.len(), "{name} {pose:?}");
                for (actual, expected) in actual.iter().zip(expected) {
                    let context = format!("{name} {engine} {pose:?}");
                    assert_eq!(actual["status"], expected["status"], "{context}: {expected}");
                    let [a, b] = [actual, expected].map(|ping| ping["range_m"].as_f64());
                    assert_eq!(a.is_some(), b.is_some(), "{context}: {expected}");
                    if let Some((a, b)) = a.zip(b) {
                        let off_m = (a - b).abs();
                        max_m = max_m.max(off_m);
                        if off_m > TOLERANCE_M {
                            different.push(format!("{context}: {a} and {b}"));
                        }
                    }
                    compared += 1;
                }
            }
        }
    }
    println!(
        "{compared} readings, {count} poses per scene: {} differ by more than {TOLERANCE_M:e} m, at most by {max_m:e} m",
        different.len()
    );
    assert_eq!(different, Vec::<String>::new());
    assert!(compared > 9 * count * BEAMS);
}

/// Random valid poses, with a fixed seed.
fn poses(scene: &Scene, count: usize) -> Vec<Pose> {
    let mut rng = Pcg64Mcg::seed_from_u64(18);
    let middle = scene.poses.values().next().expect("a pose").position();
    let points = scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let (low, high) =
        points.fold((middle, middle), |(low, high), point| (low.min(point), high.max(point)));
    let candidates = std::iter::repeat_with(|| Pose {
        x_m: rng.random_range(low.x..=high.x),
        y_m: rng.random_range(low.y..=high.y),
        heading_deg: rng.random_range(0.0..360.0),
    });
    candidates.take(200_000).filter(|pose| scene.check_pose(pose).is_ok()).take(count).collect()
}

fn program_readings(scene: &str, engine: &str, course: &str) -> Vec<Value> {
    let (step, max_range) = (STEP_DEG.to_string(), MAX_RANGE_M.to_string());
    let simulate = ["simulate", "--scene", scene, "--poses", course, "--engine", engine];
    let output = run(&[&simulate[..], &["--step-deg", &step, "--max-range", &max_range]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let records = text.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    records.filter(|record| record["type"] == "ping").collect()
}

fn page_readings(browser: &Browser, scene: &str, engine: &str, pose: &Pose) -> Vec<Value> {
    let settings = json!({
        "scene": scene, "sensor": "senscomp-6500", "options": {"max_range_m": MAX_RANGE_M},
        "air": {"temperature_c": 20, "humidity_percent": 50},
    });
    let plan = json!({"from_deg": 0, "to_deg": 360, "step_deg": STEP_DEG, "pings_per_stop": 1});
    let send = |request: Value| {
        let message = format!("{{kind: 'request', request: {request}}}");
        eval_json(browser, &format!("playground.request({message})"))
    };
    send(json!({"type": "configure", "settings": settings}));
    send(json!({"type": "start_sweep", "engine": engine, "pose": pose, "plan": plan}));
    let response = send(json!({"type": "next_readings", "engine": engine, "count": 1000}));
    response["readings"].as_array().expect("readings").clone()
}
