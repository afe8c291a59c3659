//! Tracking of a robot between sweeps.

use std::sync::Arc;

use sonard_model::{
    acoustics::{Air, Sensor, TofNoise},
    geometry::{DVec2, Pose, wrap_180},
    model::Options,
    scene::Scene,
};

use super::recovery::sweep;
use crate::{CoarseGrid, FitSweep, Odometry, PoseMode, Tracker, World, locate};

/// Room whose ends look alike when rotated by 180 degrees, with a short wall near its middle that
/// breaks the symmetry.
const ROOM: &str = r#"{"name": "long room", "materials": {"plaster": {"reflectance": 0.95}}, "walls": [
    {"id": "w", "polyline": [[0, 0], [5, 0], [5, 1], [0, 1]], "closed": true, "material": "plaster"},
    {"id": "stub", "from": [2.9, 1], "to": [2.9, 0.6], "material": "plaster"}]}"#;

fn long_room() -> (World, CoarseGrid) {
    let scene = Arc::new(Scene::from_json(ROOM).expect("a scene"));
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let options = Options { max_range_m: Some(1.5), ..Options::default() };
    let world = World::new(scene, sensor, Air::default(), options);
    let atlas = CoarseGrid::new(&world, 0.1).expect("an atlas");
    (world, atlas)
}

/// Trajectory from one end over the middle to the other end.
const TRAJECTORY: [(f64, f64, f64); 5] =
    [(0.6, 0.4, 10.0), (1.4, 0.5, -20.0), (2.2, 0.4, 5.0), (3.4, 0.35, 30.0), (4.4, 0.6, 80.0)];

fn pose((x_m, y_m, heading_deg): (f64, f64, f64)) -> Pose {
    Pose { x_m, y_m, heading_deg }
}

/// Sweep with a pose by odometry that drifts, in a frame that is rotated and shifted.
fn swept(world: &World, true_pose: &Pose, drift_m: f64, turn_deg: f64) -> FitSweep {
    let at = DVec2::from_angle(turn_deg.to_radians()).rotate(true_pose.position());
    let odometry = Pose {
        x_m: at.x + 7.0 + drift_m,
        y_m: at.y - 3.0,
        heading_deg: true_pose.heading_deg + turn_deg + 10.0 * drift_m,
    };
    let noise = TofNoise::from_range_sigma_mm(1.0, world.air.sound_speed_m_s());
    sweep(world, true_pose, &odometry, 90, noise, 5)
}

fn is_there(mode: &PoseMode, pose: &Pose) -> bool {
    DVec2::new(mode.x_m, mode.y_m).distance(pose.position()) < 0.02
        && wrap_180(mode.heading_deg - pose.heading_deg).abs() < 1.5
}

#[test]
fn symmetric_ends_are_separated_by_odometry() {
    let (world, atlas) = long_room();
    let mut course = Tracker::new(Odometry::default());
    for (at, true_pose) in TRAJECTORY.map(pose).iter().enumerate() {
        let sweep = swept(&world, true_pose, 0.01 * at as f64, 40.0);
        let modes = course.next(&world, &atlas, &sweep).expect("a model");
        let total: f64 = modes.iter().map(|mode| mode.probability).sum();
        assert!((total - 1.0).abs() < 1e-2, "{modes:?}");
        if at == 0 || at == TRAJECTORY.len() - 1 {
            let alone = locate(&world, &atlas, &sweep).expect("a model");
            let of = alone.iter().find(|mode| is_there(mode, true_pose)).expect("is listed");
            assert!((0.2..0.8).contains(&of.probability), "{at}: {alone:?}");
        }
        if at >= 2 {
            assert!(is_there(&modes[0], true_pose), "{at}: {modes:?}");
            assert!(modes[0].probability > 0.99, "{at}: {modes:?}");
        }
    }
}

#[test]
fn kidnapped_robot_is_relocalized() {
    let (world, atlas) = long_room();
    let mut course = Tracker::new(Odometry::default());
    for true_pose in &TRAJECTORY.map(pose)[..3] {
        course.next(&world, &atlas, &swept(&world, true_pose, 0.0, 0.0)).expect("a model");
    }
    let odometry = swept(&world, &pose(TRAJECTORY[2]), 0.0, 0.0).pose;
    let here = pose((3.6, 0.3, -70.0));
    // Odometry reports no motion.
    let carried = FitSweep { pose: odometry, ..swept(&world, &here, 0.0, 0.0) };
    let modes = course.next(&world, &atlas, &carried).expect("a model");
    assert!(is_there(&modes[0], &here) && modes[0].probability > 0.9, "{modes:?}");
}

#[test]
fn odometry_frame_is_arbitrary() {
    let (world, atlas) = long_room();
    let all_carried = Odometry { kidnap_probability: 1.0, ..Odometry::default() };
    let mut courses = [Odometry::default(), Odometry::default(), all_carried].map(Tracker::new);
    for true_pose in TRAJECTORY.map(pose) {
        let turned = [0.0, 135.0, 0.0].map(|turn_deg| swept(&world, &true_pose, 0.0, turn_deg));
        let [fixed, rotated, carried] = std::array::from_fn(|at| {
            courses[at].next(&world, &atlas, &turned[at]).expect("a model")
        });
        assert_eq!(fixed.len(), rotated.len());
        for (a, b) in fixed.iter().zip(&rotated) {
            assert!((a.x_m - b.x_m).abs() < 1e-6, "{a:?} {b:?}");
            assert!((a.probability - b.probability).abs() < 1e-6, "{a:?} {b:?}");
        }
        let alone = locate(&world, &atlas, &turned[2]).expect("a model");
        assert!(
            (carried[0].probability - alone[0].probability).abs() < 1e-2,
            "{carried:?} {alone:?}"
        );
    }
}

#[test]
fn another_scene_resets_the_tracker() {
    let (world, atlas) = long_room();
    let other = Arc::new(Scene { name: "another".to_owned(), ..Scene::clone(&world.scene) });
    let elsewhere = World { scene: other, ..world.clone() };
    let mut course = Tracker::new(Odometry::default());
    for true_pose in &TRAJECTORY.map(pose)[..3] {
        course.next(&world, &atlas, &swept(&world, true_pose, 0.0, 0.0)).expect("a model");
    }
    let sweep = swept(&world, &pose(TRAJECTORY[4]), 0.0, 0.0);
    let alone = locate(&world, &atlas, &sweep).expect("a model");
    assert_eq!(course.clone().next(&elsewhere, &atlas, &sweep), Ok(alone));
    assert!(course.next(&world, &atlas, &sweep).expect("a model")[0].probability > 0.99);
}
