//! Readings by a world that differs in one thing from the one they are predicted in.

mod closed_forms;

use std::sync::Arc;

use jiff::Timestamp;
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::{PathOptions, Simulator},
    plan::ScanPlan,
    scene::{Scene, shipped},
};
use sonard_records::{ScanView, SimRecord};
use uuid::Uuid;

use super::Explanation;
use crate::compare::{Comparison, compare};

/// What readings are of.
#[derive(Clone)]
struct World {
    scene: Scene,
    pose: Pose,
    air: Air,
    sensor: Sensor,
}

impl World {
    fn believed() -> Self {
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

/// Readings of one world, with another's predictions beside them; ranges are computed with the speed of sound that
/// is believed.
fn compared(truth: &World, believed: &World) -> Comparison {
    let (mut scan, _) = truth.scan();
    let (predicted, simulator) = believed.scan();
    let slower = believed.air.sound_speed_m_s() / truth.air.sound_speed_m_s();
    let point = simulator.at(believed.pose.position());
    for ping in &mut scan.pings {
        ping.range_m = ping.range_m.map(|range_m| range_m * slower);
        let prediction =
            point.ping(believed.pose.direction_rad(ping.azimuth_deg)).expect("few paths");
        ping.sim = Some(SimRecord::of(&simulator, &prediction));
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

fn close(found: &Explanation, at: usize, wanted: f64, off: f64) {
    let estimate = &found.estimates[at];
    assert!((estimate.value - wanted).abs() < off, "{wanted}: {found:?}");
}

#[test]
fn readings_of_the_world_that_is_believed_need_no_explanation() {
    let believed = World::believed();
    assert_eq!(compared(&believed, &believed).explanations, []);
}

#[test]
fn a_robot_that_stands_elsewhere_is_found() {
    let believed = World::believed();
    let mut truth = believed.clone();
    (truth.pose.x_m, truth.pose.y_m) = (1.3 + 0.021, 0.9 - 0.034);
    let comparison = compared(&truth, &believed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "pose");
    close(best, 0, 0.021, 0.003);
    close(best, 1, -0.034, 0.003);
    assert!(best.explains > 50, "{best:?}");
}

#[test]
fn a_robot_that_looks_elsewhere_is_found() {
    let believed = World::believed();
    let mut truth = believed.clone();
    truth.pose.heading_deg += 2.0;
    let comparison = compared(&truth, &believed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "heading");
    close(best, 0, 2.0, 0.3);
}

#[test]
fn colder_air_is_found() {
    let believed = World::believed();
    let truth = World { air: Air::new(14.0, 50.0, 101.325).expect("air"), ..believed.clone() };
    let comparison = compared(&truth, &believed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "sound_speed");
    let slower = 100.0 * (truth.air.sound_speed_m_s() / believed.air.sound_speed_m_s() - 1.0);
    close(best, 0, slower, 0.1);
}

#[test]
fn a_wall_that_stands_elsewhere_is_found() {
    let believed = World::believed();
    let mut truth = believed.clone();
    let wall = truth.scene.walls.iter().position(|wall| &*wall.id == "south").expect("a wall");
    let south = &mut truth.scene.walls[wall];
    (south.a.y, south.b.y) = (south.a.y - 0.049, south.b.y - 0.049);
    // The walls beside it reach down to it.
    let corners = [south.a, south.b];
    for wall in &mut truth.scene.walls {
        for end in [&mut wall.a, &mut wall.b] {
            if corners.iter().any(|corner| (*corner - *end).length() < 0.05) {
                *end = corners
                    .into_iter()
                    .min_by(|one, other| one.distance(*end).total_cmp(&other.distance(*end)))
                    .expect("two");
            }
        }
    }
    let comparison = compared(&truth, &believed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "wall south", "{:?}", comparison.explanations);
    close(best, 0, 0.049, 0.004);
}

#[test]
fn a_ranger_that_hears_less_is_found() {
    let mut believed = World::believed();
    believed.sensor.threshold = 0.05;
    let mut truth = believed.clone();
    truth.sensor.threshold *= 10.0_f64.powf(8.0 / 20.0);
    let comparison = compared(&truth, &believed);
    close(named(&comparison, "threshold"), 0, 8.0, 3.0);
}

/// What a user who measures a room gets wrong: two centimetres, two degrees, and five degrees of temperature. None of it
/// explains the readings alone.
#[test]
fn a_place_a_heading_and_the_air_are_found_together() {
    let believed = World::believed();
    let mut truth = believed.clone();
    truth.air = Air::new(15.0, 50.0, 101.325).expect("air");
    truth.pose = Pose { x_m: 1.3 - 0.02, y_m: 0.9 + 0.015, heading_deg: 22.0 };
    let comparison = compared(&truth, &believed);
    let best = &comparison.explanations[0];
    assert_eq!(best.change, "together", "{:?}", comparison.explanations);
    close(best, 0, -0.02, 0.003);
    close(best, 1, 0.015, 0.003);
    close(best, 2, 2.0, 0.3);
    let slower = 100.0 * (truth.air.sound_speed_m_s() / believed.air.sound_speed_m_s() - 1.0);
    close(best, 3, slower, 0.1);
    assert!(best.explains > 200, "{best:?}");
}

/// A scan of another room is explained by nothing of this kind.
#[test]
fn a_scan_of_another_room_is_not_explained_away() {
    let believed = World::believed();
    let mut truth = believed.clone();
    truth.scene = Scene::from_json(shipped::text("mcgill-lab").expect("shipped")).expect("a scene");
    truth.pose = truth.scene.poses.values().next().copied().expect("a pose");
    let comparison = compared(&truth, &believed);
    assert!(comparison.agree_fraction.expect("pairs") < 0.2);
    assert_eq!(comparison.explanations, []);
    // A quarter turn is as much another room.
    let turned = Pose { heading_deg: 110.0, ..believed.pose };
    let comparison = compared(&World { pose: turned, ..believed.clone() }, &believed);
    assert_eq!(comparison.explanations, []);
}
