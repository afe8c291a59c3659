//! Explorations of scenes, and the simulated robot.

use std::sync::Arc;

use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::*;
use crate::trial::gallery;
use sonard_interpret::interpret::lines::{MapError, map_error};
use sonard_inverse::World;
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::wrap_180,
    model::{Options, Simulator},
    scene::Scene,
};
use sonard_survey::{
    SurveyOptions,
    trial::{
        Comparison, Explorer, ExplorerSettings, ReadingNoise, RoomKind, draw_trial, generator,
    },
};

fn simulator(scene: Scene) -> Simulator {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    // Range of the paper's sonars and default of `sonard-papers explore`.
    let options = Options { max_range_m: Some(8.0), ..Options::default() };
    Simulator::new(Arc::new(scene), sensor, Air::default(), options).expect("figures")
}

fn rng(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

fn scene(walls: &str) -> Scene {
    let text = format!(
        r#"{{"name":"test","materials":{{"m":{{"reflectance":0.95}}}},"walls":[{walls}]}}"#
    );
    Scene::from_json(&text).expect("a scene")
}

/// A room of 4 m by 3 m.
const ROOM: &str =
    r#"{"id":"room","polyline":[[0,0],[4,0],[4,3],[0,3]],"closed":true,"material":"m"}"#;

const MIDDLE: Pose = Pose { x_m: 2.0, y_m: 1.5, heading_deg: 30.0 };

#[test]
fn laser_noise_grows_quadratically() {
    let simulator = simulator(scene(ROOM));
    let laser = Laser { usable: 1.0, ..Laser::default() };
    let settings = RobotSettings { laser, ..RobotSettings::default() };
    let mut robot = SimulatedRobot::new(&simulator, MIDDLE, settings, rng(1));
    for (direction_rad, distance_m) in [(0.0, 2.0), (std::f64::consts::FRAC_PI_2, 1.5)] {
        let mut squares = Vec::new();
        for _ in 0..40 {
            let shot = robot.laser(direction_rad);
            let [first, last] =
                [shot.returns[0], shot.returns[511]].map(|reading| reading.azimuth_deg);
            assert_eq!((shot.returns.len(), first, last), (512, -12.5, 12.5));
            squares.extend(shot.returns.iter().map(|reading| {
                let true_m = distance_m / reading.azimuth_deg.to_radians().cos();
                ((reading.range_m.expect("a wall") - true_m) / (true_m * true_m)).powi(2)
            }));
        }
        let sigma = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        // 20480 readings: the standard error of the estimate is half a percent.
        assert!((sigma / laser.sigma_at_1_m - 1.0).abs() < 0.02, "{distance_m} m: {sigma}");
    }
}

#[test]
fn laser_turn_has_rising_azimuths() {
    let simulator = simulator(scene(ROOM));
    let mut robot = SimulatedRobot::new(&simulator, MIDDLE, RobotSettings::default(), rng(2));
    let (turn, shots) = robot.laser_turn();
    assert_eq!(shots, 16);
    assert!(turn.returns.windows(2).all(|pair| pair[0].azimuth_deg < pair[1].azimuth_deg));
    let span_deg = turn.returns[turn.returns.len() - 1].azimuth_deg - turn.returns[0].azimuth_deg;
    assert!((359.0..360.0).contains(&span_deg), "{span_deg}");
}

#[test]
fn walls_stop_robot_at_its_radius() {
    let simulator = simulator(scene(ROOM));
    let settings = RobotSettings::default();
    let mut robot = SimulatedRobot::new(&simulator, MIDDLE, settings, rng(3));
    assert_eq!(robot.drive(DVec2::new(3.0, 1.0)), DriveOutcome::Arrived);
    assert!(robot.pose().position().distance(DVec2::new(3.0, 1.0)) < 1e-9);
    assert_eq!(robot.drive(DVec2::new(9.0, 1.0)), DriveOutcome::Collided);
    let clearance_m = simulator.scene().clearance_m(robot.truth().position());
    assert!((settings.radius_m..settings.radius_m + 0.06).contains(&clearance_m), "{clearance_m}");
    // The robot can leave the wall and drive along it, but not through it.
    assert_eq!(robot.drive(robot.pose().position() + DVec2::new(0.0, 0.5)), DriveOutcome::Arrived);
    for _ in 0..5 {
        robot.drive(robot.pose().position() + DVec2::new(0.5, 0.2));
    }
    assert!(simulator.scene().clearance_m(robot.truth().position()) >= settings.radius_m - 2e-3);
    assert!(robot.truth().x_m < 4.0);
}

#[test]
fn odometry_noise_is_hidden() {
    let simulator = simulator(scene(ROOM));
    let settings = RobotSettings { odometry_noise: 0.05, ..RobotSettings::default() };
    let mut robot = SimulatedRobot::new(&simulator, MIDDLE, settings, rng(4));
    for at in [[3.0, 1.5], [3.0, 1.0], [1.0, 1.0], [2.0, 1.5]] {
        robot.drive(at.into());
    }
    assert!(robot.pose().position().distance(MIDDLE.position()) < 1e-9, "by odometry");
    let off_m = robot.truth().position().distance(MIDDLE.position());
    assert!((0.005..0.8).contains(&off_m), "{off_m}");
}

#[test]
fn drift_has_its_standard_deviations() {
    const RUNS: usize = 300;
    let simulator = simulator(scene(ROOM));
    let settings = RobotSettings { drift_per_m: [0.04, 5.0], ..RobotSettings::default() };
    let start = Pose { x_m: 1.0, y_m: 1.5, heading_deg: 0.0 };
    let mut random = rng(5);
    let mut squares = [0.0; 3];
    for _ in 0..RUNS {
        let mut robot = SimulatedRobot::new(&simulator, start, settings, &mut random);
        assert_eq!(robot.drive(DVec2::new(3.0, 1.5)), DriveOutcome::Arrived);
        assert!(robot.pose().position().distance(DVec2::new(3.0, 1.5)) < 1e-9, "by odometry");
        let truth = robot.truth();
        let off = [truth.x_m - 3.0, truth.y_m - 1.5, wrap_180(truth.heading_deg)];
        squares.iter_mut().zip(off).for_each(|(sum, off)| *sum += off * off);
    }
    // Two metres; the standard error of a deviation is 4 %.
    for (sum, sigma) in squares.into_iter().zip([0.08, 0.08, 10.0]) {
        let found = (sum / RUNS as f64).sqrt();
        assert!((found / sigma - 1.0).abs() < 0.15, "{found} {sigma}");
    }
}

#[test]
fn course_has_the_true_pose_of_each_stop() {
    let simulator = simulator(scene(ROOM));
    let settings = RobotSettings { drift_per_m: [0.05, 5.0], ..RobotSettings::default() };
    for sensing in Sensing::ALL {
        let mut robot = SimulatedRobot::new(&simulator, MIDDLE, settings, rng(6));
        let limited = ExploreSettings { max_stops: 5, ..ExploreSettings::default() };
        let made = explore(&mut robot, sensing, &limited);
        assert_eq!((robot.course().len(), robot.course()[0]), (made.stops.len(), MIDDLE));
        assert_eq!(robot.course().last(), Some(&robot.truth()));
    }
}

/// Robot whose sensors detect nothing.
struct NoReadings(Pose);

impl Robot for NoReadings {
    fn pose(&self) -> Pose {
        self.0
    }
    fn sonar(&mut self) -> Sweep {
        Sweep { pose: self.0, step_deg: 2.0, beams: Vec::new(), closed: true }
    }
    fn laser(&mut self, _: f64) -> LaserScan {
        LaserScan { pose: self.0, returns: Vec::new() }
    }
    fn laser_turn(&mut self) -> (LaserScan, u32) {
        (LaserScan { pose: self.0, returns: Vec::new() }, 16)
    }
    fn drive(&mut self, _: DVec2) -> DriveOutcome {
        panic!("there is nothing to drive to")
    }
}

#[test]
fn empty_readings_end_the_exploration() {
    for sensing in Sensing::ALL {
        let made = explore(&mut NoReadings(MIDDLE), sensing, &ExploreSettings::default());
        assert_eq!((made.stops.len(), made.lines().len(), made.finished), (1, 0, true));
    }
}

fn explored(
    simulator: &Simulator,
    pose: Pose,
    sensing: Sensing,
    seed: u64,
) -> (Exploration, MapError) {
    let settings = RobotSettings::default();
    let mut robot = SimulatedRobot::new(simulator, pose, settings, rng(seed));
    let made = explore(&mut robot, sensing, &ExploreSettings::default());
    let error = map_error(made.lines(), simulator.scene());
    (made, error)
}

#[test]
fn exploration_is_reproducible() {
    let simulator = simulator(scene(ROOM));
    let make = || explored(&simulator, MIDDLE, Sensing::JustInTime, 7).0;
    let made = make();
    assert!(made.finished && made.collisions == 0, "{} stops", made.stops.len());
    assert_eq!(made, make());
}

/// A rectangle needs no more than one view, whatever the errors of odometry.
#[test]
fn views_complete_a_rectangle() {
    let noise = ReadingNoise { sigma_db: 0.5, sigma_m: 0.001 };
    let settings = ExplorerSettings { beams: 200, noise, odometry_per_m: [0.05, 5.0] };
    let (room, course) =
        draw_trial(RoomKind::Rectangle, 2, &mut generator(RoomKind::Rectangle, 1000))
            .expect("a room");
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let options = Options { max_range_m: Some(4.0), ..Options::default() };
    let world = World::new(Arc::new(room), sensor, Air::default(), options);
    let mut explorer = Explorer::new(&world, settings);
    let found = explore_views(&mut explorer, &course, &SurveyOptions::default(), 6, &mut rng(1000))
        .expect("a survey");
    assert!((2..=3).contains(&explorer.stops().len()), "{} stops", explorer.stops().len());
    assert_eq!(found.next_view, None);
    let Comparison { recall, precision, .. } =
        Comparison::new(&found, &world.scene, explorer.stops());
    assert!(recall > 0.995 && precision > 0.995, "{recall} {precision}");
}

/// Claims of the paper in the ten rooms of `sonard-papers benchmark explore`.
#[test]
fn just_in_time_matches_laser_only() {
    let rooms: Vec<[(Exploration, MapError); 2]> = (0..10_u64)
        .into_par_iter()
        .map(|room| {
            let seed = 1_000_003 ^ room;
            let scene = gallery("gallery", &mut rng(seed));
            let pose = scene.poses["start"];
            let simulator = simulator(scene);
            [Sensing::Laser, Sensing::JustInTime]
                .map(|sensing| explored(&simulator, pose, sensing, seed))
        })
        .collect();
    for (number, [laser, just_in_time]) in (1..).zip(&rooms) {
        let shots = [laser.0.laser_shots, just_in_time.0.laser_shots];
        assert!(4 * shots[1] <= shots[0], "room {number}: {shots:?} shots");
        assert!(laser.0.finished && just_in_time.0.finished, "room {number}");
        assert_eq!((laser.0.collisions, just_in_time.0.collisions), (0, 0), "room {number}");
    }
    let mean = |kind: usize| {
        rooms.iter().map(|room| room[kind].1.map_error_m).sum::<f64>() / rooms.len() as f64
    };
    let (laser_m, just_in_time_m) = (mean(0), mean(1));
    assert!(just_in_time_m <= 1.2 * laser_m, "{just_in_time_m} m against {laser_m} m");
}

#[test]
fn sonar_only_is_much_worse() {
    let seed = 1_000_003 ^ 2;
    let scene = gallery("gallery", &mut rng(seed));
    let pose = scene.poses["start"];
    let simulator = simulator(scene);
    let (_, sonar) = explored(&simulator, pose, Sensing::Sonar, seed);
    let (_, just_in_time) = explored(&simulator, pose, Sensing::JustInTime, seed);
    assert!(sonar.line_error_m > 5.0 * just_in_time.line_error_m, "{sonar:?} {just_in_time:?}");
    assert!(sonar.endpoint_error_m > 5.0 * just_in_time.endpoint_error_m);
}
