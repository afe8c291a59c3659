//! What the page reads is what the program reads.

use std::{fmt::Write as _, fs};

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use sonard::{
    geometry::Pose,
    scene::{Scene, shipped},
};

use super::{open, told};
use crate::live_page::browser::{Browser, DESK};
use sonard_test_support::{run, stderr};

/// Poses tried in each scene: `SONARD_PLAYGROUND_POSES` for more.
const POSES: usize = 6;
const STEP_DEG: f64 = 7.2;
/// Beams of a full turn.
const BEAMS: usize = 50;
const REACH_M: f64 = 4.0;
const SAME_M: f64 = 1e-9;

#[test]
fn readings_are_those_of_the_program_in_every_shipped_scene() {
    let browser = open(DESK);
    let wanted = std::env::var("SONARD_PLAYGROUND_POSES").ok();
    let count = wanted.and_then(|count| count.parse().ok()).unwrap_or(POSES);
    let folder = tempfile::tempdir().expect("a folder");
    let mut compared = 0;
    let mut most_m: f64 = 0.0;
    let mut apart: Vec<String> = Vec::new();
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
            let own = of_program(name, engine, &course.display().to_string());
            for (pose, own) in poses.iter().zip(own.chunks(BEAMS)) {
                let page = of_page(&browser, text, engine, pose);
                assert_eq!(page.len(), own.len(), "{name} {pose:?}");
                for (page, own) in page.iter().zip(own) {
                    assert_eq!(page["status"], own["status"], "{name} {engine} {pose:?}: {own}");
                    let [page_m, own_m] = [page, own].map(|ping| ping["range_m"].as_f64());
                    assert_eq!(page_m.is_some(), own_m.is_some(), "{name} {pose:?}: {own}");
                    if let Some((page_m, own_m)) = page_m.zip(own_m) {
                        let off_m = (page_m - own_m).abs();
                        most_m = most_m.max(off_m);
                        if off_m > SAME_M {
                            apart.push(format!("{name} {engine} {pose:?}: {page_m} and {own_m}"));
                        }
                    }
                    compared += 1;
                }
            }
        }
    }
    println!(
        "{compared} readings of {count} poses a scene: {} apart by more than {SAME_M:e} m, the most by {most_m:e} m",
        apart.len()
    );
    assert_eq!(apart, Vec::<String>::new());
    assert!(compared > 9 * count * BEAMS);
}

/// Where a ranger can stand, drawn by a seed.
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

fn of_program(scene: &str, engine: &str, course: &str) -> Vec<Value> {
    let (step, reach) = (STEP_DEG.to_string(), REACH_M.to_string());
    let simulate = ["simulate", "--scene", scene, "--poses", course, "--engine", engine];
    let output = run(&[&simulate[..], &["--step-deg", &step, "--max-range", &reach]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let records = text.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    records.filter(|record| record["type"] == "ping").collect()
}

fn of_page(browser: &Browser, scene: &str, engine: &str, pose: &Pose) -> Vec<Value> {
    let settings = json!({
        "scene": scene, "sensor": "senscomp-6500", "options": {"max_range_m": REACH_M},
        "air": {"temperature_c": 20, "humidity_percent": 50},
    });
    let plan = json!({"from_deg": 0, "to_deg": 360, "step_deg": STEP_DEG, "pings_per_stop": 1});
    let ask = |request: Value| {
        told(browser, &format!("playground.ask({{kind: 'ask', request: {request}}})"))
    };
    ask(json!({"ask": "set", "settings": settings}));
    ask(json!({"ask": "stand", "engine": engine, "pose": pose, "plan": plan}));
    let told = ask(json!({"ask": "more", "engine": engine, "count": 1000}));
    told["readings"].as_array().expect("readings").clone()
}
