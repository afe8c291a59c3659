//! Predictions of every shipped scene, pose, sensor and engine, held to those that are kept in
//! `tests/golden/predictions.jsonl`.
//!
//! The file is no proof that a reading is right (laws, closed forms and full waves are): it holds that a
//! change which is meant to move code moves no reading. Where a reading changes on purpose, CHANGELOG.md states
//! it and `SONARD_GOLDEN=write cargo test --test golden` rewrites the file.

use std::{fmt::Write as _, sync::Arc};

use serde::{Deserialize, Serialize};
use sonard::{
    acoustics::{Air, Sensor},
    model::{EngineKind, EngineOptions, FanOptions, Options, Prediction, Simulator},
    scan::ScanPlan,
    scene::{Scene, shipped},
};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/predictions.jsonl");

/// Greatest differences that count as none.
const RANGE_M: f64 = 1e-9;
const LEVEL_DB: f64 = 1e-6;

/// A full turn of one ranger at one place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Turn {
    scene: String,
    pose: String,
    sensor: String,
    engine: EngineKind,
    /// First letter of the status of each beam.
    status: String,
    range_m: Vec<Option<f64>>,
    length_m: Vec<Option<f64>>,
    amplitude: Vec<Option<f64>>,
}

impl Turn {
    fn name(&self) -> String {
        format!("{}/{}/{}/{}", self.scene, self.pose, self.sensor, self.engine.name())
    }

    fn of(names: [&str; 3], engine: EngineKind, predictions: &[Prediction]) -> Self {
        let [scene, pose, sensor] = names.map(str::to_owned);
        let status = predictions.iter().map(|one| format!("{:?}", one.status));
        Self {
            scene,
            pose,
            sensor,
            engine,
            status: status.filter_map(|word| word.chars().next()).collect(),
            range_m: predictions.iter().map(|one| one.range_m.map(rounded)).collect(),
            length_m: predictions
                .iter()
                .map(|one| one.arrival.as_ref().map(|arrival| rounded(arrival.length_m)))
                .collect(),
            amplitude: predictions.iter().map(|one| one.amplitude.map(rounded)).collect(),
        }
    }

    /// Lists the differences from `kept`, a line for each beam.
    fn differences(&self, kept: &Self, printed: &mut String) {
        for (beam, (is, was)) in self.status.chars().zip(kept.status.chars()).enumerate() {
            if is != was {
                let _ = writeln!(printed, "{} beam {beam}: status {was} is now {is}", self.name());
            }
        }
        let level_db = |amplitude: f64| 20.0 * amplitude.log10();
        let metres = |length_m: f64| length_m;
        let mut compare =
            |what, is: &[Option<f64>], was: &[Option<f64>], unit: fn(f64) -> f64, bound| {
                for (beam, pair) in is.iter().zip(was).enumerate() {
                    let apart = match pair {
                        (Some(is), Some(was)) => (unit(*is) - unit(*was)).abs() > bound,
                        (is, was) => is.is_some() != was.is_some(),
                    };
                    if apart {
                        let _ = writeln!(
                            printed,
                            "{} beam {beam}: {what} {:?} is now {:?}",
                            self.name(),
                            pair.1,
                            pair.0
                        );
                    }
                }
            };
        compare("range_m", &self.range_m, &kept.range_m, metres, RANGE_M);
        compare("length_m", &self.length_m, &kept.length_m, metres, 2.0 * RANGE_M);
        compare("amplitude", &self.amplitude, &kept.amplitude, level_db, LEVEL_DB);
    }
}

/// To twelve digits, so that the file stays small.
fn rounded(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// Every 7.2 degrees round the circle: eight motor steps.
const PLAN: ScanPlan = ScanPlan { from_deg: 0.0, to_deg: 360.0, step_deg: 7.2, pings_per_stop: 1 };

fn turns(scene_name: &str, text: &str) -> Vec<Turn> {
    let scene = Arc::new(Scene::from_json(text).expect("golden predictions"));
    let air = Air::default();
    let mut turns = Vec::new();
    for sensor_name in Sensor::preset_names() {
        for engine in [EngineKind::Paths, EngineKind::Fan, EngineKind::Cone] {
            let sensor = Sensor::preset(sensor_name).expect("golden predictions");
            // The default spacing is fifty times as slow and reads the same.
            let fan = FanOptions { ray_spacing_deg: 1.0, ..FanOptions::default() };
            let options = match engine {
                EngineKind::Fan => EngineOptions::from(fan),
                other => other.options(),
            };
            let options = Options::from(options);
            let simulator = Simulator::new(Arc::clone(&scene), sensor, air, options)
                .expect("golden predictions");
            for (pose_name, pose) in &scene.poses {
                let predictions = simulator.predict(pose, &PLAN).expect("few paths");
                turns.push(Turn::of([scene_name, pose_name, sensor_name], engine, &predictions));
            }
        }
    }
    turns
}

fn check(scene: &str) {
    let text = shipped::text(scene).expect("golden predictions");
    let kept: Vec<Turn> = std::fs::read_to_string(FILE)
        .expect("golden predictions")
        .lines()
        .map(|line| serde_json::from_str(line).expect("golden predictions"))
        .filter(|turn: &Turn| turn.scene == scene)
        .collect();
    let turns = turns(scene, text);
    assert_eq!(turns.len(), kept.len(), "{scene}: scenes, poses, sensors or engines came or went");
    let mut printed = String::new();
    for (turn, kept) in turns.iter().zip(&kept) {
        assert_eq!(turn.name(), kept.name());
        turn.differences(kept, &mut printed);
    }
    assert!(printed.is_empty(), "{printed}");
}

macro_rules! scenes {
    ($($test:ident $scene:literal),* $(,)?) => {
        $(#[test] fn $test() { check($scene); })*

        #[test]
        fn every_shipped_scene_is_here() {
            let mut here = vec![$($scene),*];
            let mut shipped: Vec<_> = shipped::names().collect();
            here.sort_unstable();
            shipped.sort_unstable();
            assert_eq!(here, shipped);
            if std::env::var("SONARD_GOLDEN").is_ok_and(|value| value == "write") {
                let turns = shipped::SCENES.iter().flat_map(|(name, text)| turns(name, text));
                let lines = turns.map(|turn| serde_json::to_string(&turn).expect("golden predictions") + "\n");
                std::fs::write(FILE, lines.collect::<String>()).expect("golden predictions");
            }
        }
    };
}

scenes! {
    simple_room "simple-room",
    simple_room_robot "simple-room-robot",
    echo_traces "echo-traces",
    mcgill_lab "mcgill-lab",
    oblique_corner "oblique-corner",
    right_angle_corner "right-angle-corner",
    two_surface_room "two-surface-room",
    corridor "corridor",
    plane_corner_edge "plane-corner-edge",
}
