//! Recovery of one or more changes between the true world and the assumed one.

mod closed_forms;

use std::sync::Arc;

use jiff::Timestamp;
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::{PathOptions, Simulator},
    scan_plan::ScanPlan,
    scene::{Scene, shipped},
};
use sonard_records::{ScanView, SimRecord};
use uuid::Uuid;

use super::Explanation;
use crate::compare::{Comparison, compare};

/// Conditions under which readings are simulated.
#[derive(Clone)]
struct World {
    scene: Scene,
    pose: Pose,
    air: Air,
    sensor: Sensor,
}

impl World {
    fn assumed() -> Self {
        let scene = Scene::from_json(shipped::text("two-surface-room").expect("shipped"));
        let scene = scene.expect("a scene");
        let pose = Pose { x_m: 1.3, y_m: 0.9, heading_deg: 20.0 };
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        Self { scene, pose, air: Air::default(), sensor }
    }

    fn scan(&self) -> (ScanView, Simulator) {
        let options = PathOptions { ideal_receiver: true, ..PathOptions::default() }.into();
        let scene = Arc::new(self.scene.clone());
        let simulator =
            Simulator::new(scene, self.sensor.clone(), self.air, options).expect("a model");
        let plan = ScanPlan { step_deg: 0.9, ..ScanPlan::default() };
        let scan =
            ScanView::simulated(&simulator, Uuid::nil(), &self.pose, &plan, Timestamp::UNIX_EPOCH)
                .expect("few paths");
        (scan, simulator)
    }
}

/// Readings of one world with the predictions of another; ranges are computed with the assumed
/// speed of sound.
fn compared(truth: &World, assumed: &World) -> Comparison {
    let (mut scan, _) = truth.scan();
    let (predicted, simulator) = assumed.scan();
    let slower = assumed.air.sound_speed_m_s() / truth.air.sound_speed_m_s();
    let point = simulator.at(assumed.pose.position());
    for ping in &mut scan.pings {
        ping.range_m = ping.range_m.map(|range_m| range_m * slower);
        let prediction =
            point.ping(assumed.pose.direction_rad(ping.azimuth_deg)).expect("few paths");
        ping.sim = Some(SimRecord::from_prediction(&simulator, &prediction));
        (ping.path, ping.amplitude, ping.margin_db) = (None, None, None);
    }
    scan.session = predicted.session;
    scan.start = predicted.start;
    compare(&[scan]).0
}

fn named<'a>(comparison: &'a Comparison, change: &str) -> &'a Explanation {
    let found = comparison.explanations.iter().find(|found| found.change == change);
    found.unwrap_or_else(|| panic!("no {change}: {:?}", comparison.explanations))
}

fn assert_close(found: &Explanation, at: usize, expected: f64, tolerance: f64) {
    let estimate = &found.estimates[at];
    assert!((estimate.value - expected).abs() < tolerance, "{expected}: {found:?}");
}

#[test]
fn identical_worlds_are_not_explained() {
    let assumed = World::assumed();
    assert_eq!(compared(&assumed, &assumed).explanations, []);
}

#[test]
fn pose_offset_is_found() {
    let assumed = World::assumed();
    let mut truth = assumed.clone();
    (truth.pose.x_m, truth.pose.y_m) = (1.3 + 0.021, 0.9 - 0.034);
    let comparison = compared(&truth, &assumed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "pose");
    assert_close(best, 0, 0.021, 0.003);
    assert_close(best, 1, -0.034, 0.003);
    assert!(best.explains > 50, "{best:?}");
}

#[test]
fn heading_offset_is_found() {
    let assumed = World::assumed();
    let mut truth = assumed.clone();
    truth.pose.heading_deg += 2.0;
    let comparison = compared(&truth, &assumed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "heading");
    assert_close(best, 0, 2.0, 0.3);
}

#[test]
fn colder_air_is_found() {
    let assumed = World::assumed();
    let truth = World { air: Air::new(14.0, 50.0, 101.325).expect("air"), ..assumed.clone() };
    let comparison = compared(&truth, &assumed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "sound_speed");
    let slower = 100.0 * (truth.air.sound_speed_m_s() / assumed.air.sound_speed_m_s() - 1.0);
    assert_close(best, 0, slower, 0.1);
}

#[test]
fn displaced_wall_is_found() {
    let assumed = World::assumed();
    let mut truth = assumed.clone();
    let wall = truth.scene.walls.iter().position(|wall| &*wall.id == "south").expect("a wall");
    let south = &mut truth.scene.walls[wall];
    (south.a.y, south.b.y) = (south.a.y - 0.049, south.b.y - 0.049);
    // The adjacent walls are extended to it.
    let corners = [south.a, south.b];
    for wall in &mut truth.scene.walls {
        for end in [&mut wall.a, &mut wall.b] {
            if corners.iter().any(|corner| (*corner - *end).length() < 0.05) {
                *end = corners
                    .into_iter()
                    .min_by(|a, b| a.distance(*end).total_cmp(&b.distance(*end)))
                    .expect("two");
            }
        }
    }
    let comparison = compared(&truth, &assumed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "wall south", "{:?}", comparison.explanations);
    assert_close(best, 0, 0.049, 0.004);
}

#[test]
fn higher_threshold_is_found() {
    let mut assumed = World::assumed();
    assumed.sensor.threshold = 0.05;
    let mut truth = assumed.clone();
    truth.sensor.threshold *= 10.0_f64.powf(8.0 / 20.0);
    let comparison = compared(&truth, &assumed);
    assert_close(named(&comparison, "threshold"), 0, 8.0, 3.0);
}

/// Typical errors of a user who measures a room: two centimetres, two degrees, and five degrees
/// Celsius. No single change explains the readings.
#[test]
fn pose_heading_and_air_are_combined() {
    let assumed = World::assumed();
    let mut truth = assumed.clone();
    truth.air = Air::new(15.0, 50.0, 101.325).expect("air");
    truth.pose = Pose { x_m: 1.3 - 0.02, y_m: 0.9 + 0.015, heading_deg: 22.0 };
    let comparison = compared(&truth, &assumed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "together", "{:?}", comparison.explanations);
    assert_close(best, 0, -0.02, 0.003);
    assert_close(best, 1, 0.015, 0.003);
    assert_close(best, 2, 2.0, 0.3);
    let slower = 100.0 * (truth.air.sound_speed_m_s() / assumed.air.sound_speed_m_s() - 1.0);
    assert_close(best, 3, slower, 0.1);
    assert!(best.explains > 200, "{best:?}");
}

/// A scan of another room is explained by no small change.
#[test]
fn other_room_is_not_explained() {
    let assumed = World::assumed();
    let mut truth = assumed.clone();
    truth.scene = Scene::from_json(shipped::text("mcgill-lab").expect("shipped")).expect("a scene");
    truth.pose = truth.scene.poses.values().next().copied().expect("a pose");
    let comparison = compared(&truth, &assumed);
    assert!(comparison.agree_fraction.expect("pairs") < 0.2);
    assert_eq!(comparison.explanations, []);
    // A quarter turn is as bad as another room.
    let turned = Pose { heading_deg: 110.0, ..assumed.pose };
    let comparison = compared(&World { pose: turned, ..assumed.clone() }, &assumed);
    assert_eq!(comparison.explanations, []);
}
