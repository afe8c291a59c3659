//! Moves of the exploring robot.

use std::sync::Arc;

use rand::SeedableRng;
use rand_pcg::Pcg64;
use sonard_inverse::World;
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    model::Options,
    scene::Scene,
};

use super::{Explorer, ExplorerSettings, ReadingNoise, explorer::CONTACT_M};

/// Room of 4 m by 3 m with a partition that ends 1 m before the upper wall.
fn world() -> World {
    let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
    let room = Scene::builder("room").material("wall", 0.97).room("wall", &corners, "wall");
    let room = room.walls("partition", &[[2.0, 0.0], [2.0, 2.0]], "wall");
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let options = Options { max_range_m: Some(1.0), ..Options::default() };
    World::new(Arc::new(room.build().expect("a room")), sensor, Air::default(), options)
}

fn settings(odometry_per_m: [f64; 2]) -> ExplorerSettings {
    let noise = ReadingNoise { sigma_db: 0.5, sigma_m: 0.001 };
    ExplorerSettings { beams: 4, noise, odometry_per_m }
}

const START: Pose = Pose { x_m: 1.0, y_m: 1.0, heading_deg: 30.0 };

fn random() -> Pcg64 {
    Pcg64::seed_from_u64(1)
}

fn is_near(a: DVec2, b: DVec2) -> bool {
    a.distance(b) < 1e-9
}

#[test]
fn driven_distance_is_that_of_straight_moves() {
    let (world, mut random) = (world(), random());
    let mut explorer = Explorer::new(&world, settings([0.0; 2]));
    let course = [START, Pose { y_m: 2.4, ..START }];
    explorer.sweep_along(&course, &mut random).expect("sweeps");
    assert!((explorer.driven_m() - 1.4).abs() < 1e-9, "{}", explorer.driven_m());
    // To the right straight from the second stop, then back to both stops and down from the first.
    for (place, driven_m) in [([2.4, 2.4], 2.8), ([1.0, 0.5], 2.8 + 1.4 + 1.4 + 0.5)] {
        let way = explorer.way_to(place.into(), 1.5).expect("a way");
        explorer.drive(way, &mut random).expect("a sweep");
        let [.., last] = explorer.stops() else { panic!("no stop") };
        assert!(is_near(last.position(), place.into()), "{last:?}");
        assert!((explorer.driven_m() - driven_m).abs() < 1e-9, "{}", explorer.driven_m());
    }
    assert_eq!(explorer.readings().len(), 4);
    // Odometry without errors is the truth.
    for (of, truth) in explorer.readings().iter().zip(explorer.stops()) {
        assert!(is_near(of.pose.position(), truth.position()), "{of:?} {truth:?}");
        assert!((of.pose.heading_deg - truth.heading_deg).abs() < 1e-9, "{of:?} {truth:?}");
    }
}

#[test]
fn walls_end_a_move_at_the_contact_distance() {
    let (world, mut random) = (world(), random());
    let mut explorer = Explorer::new(&world, settings([0.0; 2]));
    let behind = DVec2::new(3.0, 1.0);
    assert_eq!(explorer.way_to_view(behind, 2.5), None);
    explorer.sweep_along(&[START], &mut random).expect("a sweep");
    assert_eq!(explorer.way_to(behind, 2.5), None, "through the partition");
    assert_eq!(explorer.way_to(DVec2::new(1.0, 2.0), 0.9), None, "beyond the reach");
    let way = explorer.way_to_view(behind, 2.5).expect("the nearest stop");
    explorer.drive(way, &mut random).expect("a sweep");
    let reached = explorer.stops()[1].position();
    assert!((reached.y - START.y_m).abs() < 1e-9, "{reached}");
    let clearance_m = 2.0 - reached.x;
    assert!((CONTACT_M..CONTACT_M + 0.02).contains(&clearance_m), "{clearance_m}");
    assert!((explorer.driven_m() - (reached.x - START.x_m)).abs() < 1e-9);
}

#[test]
fn odometry_has_its_standard_deviation() {
    const RUNS: usize = 200;
    let (world, mut random) = (world(), random());
    let to = Pose { x_m: 1.0, y_m: 2.0, heading_deg: 80.0 };
    let (mut squares_m2, mut squares_deg2) = (0.0, 0.0);
    for _ in 0..RUNS {
        let mut explorer = Explorer::new(&world, settings([0.03, 4.0]));
        explorer.sweep_along(&[START, to], &mut random).expect("sweeps");
        let [first, second] = [0, 1].map(|at| explorer.readings()[at].pose);
        assert_eq!(first, START);
        squares_m2 += second.position().distance_squared(to.position()) / 2.0;
        squares_deg2 += (second.heading_deg - to.heading_deg).powi(2);
    }
    let [sigma_m, sigma_deg] = [squares_m2, squares_deg2].map(|sum| (sum / RUNS as f64).sqrt());
    // Standard errors are 3.5 and 5 % of the deviations of a move of one metre.
    assert!((sigma_m / 0.03 - 1.0).abs() < 0.15, "{sigma_m}");
    assert!((sigma_deg / 4.0 - 1.0).abs() < 0.2, "{sigma_deg}");
}
