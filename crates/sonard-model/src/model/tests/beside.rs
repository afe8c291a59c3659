//! Firings of a transducer beside an observation point.

use super::*;
use crate::{model::Prediction, reading::PingStatus};

/// Room of four walls without a right angle, in which every wall is visible from everywhere.
fn room() -> Simulator {
    let corners = [(0.0, 0.0), (3.1, 0.2), (2.9, 2.6), (-0.2, 2.2)];
    let walls = (0..4).map(|at| {
        let (id, next) = (["south", "east", "north", "west"][at], (at + 1) % 4);
        wall(id, corners[at], corners[next], 0.97)
    });
    simulator(scene(walls.collect()), Options { max_range_m: Some(5.0), ..Options::default() })
}

fn firings() -> impl Iterator<Item = (DVec2, f64)> {
    let places = [(1.0, 1.0), (1.9, 1.4), (1.2, 1.6)];
    let directions = (0..120).map(|at| (3.0 * f64::from(at)).to_radians());
    let at = move |place: (f64, f64)| directions.clone().map(move |to| (DVec2::from(place), to));
    places.into_iter().flat_map(at)
}

fn is_single_reflection(prediction: &Prediction) -> bool {
    prediction.arrival.as_ref().is_some_and(|of| of.path.interactions.len() == 1)
}

/// Echoes of a wall equal those at the transducer itself, except for the absorption along the offset
/// and its time walk.
#[test]
fn echoes_of_a_plane_wall_are_exact_beside_a_point() {
    let simulator =
        simulator(scene(vec![wall("south", (-9.0, -0.5), (9.0, 0.4), 0.97)]), Options::default());
    let mut compared = 0;
    for (place, direction_rad) in firings() {
        let offset = DVec2::from_angle(direction_rad + 0.3) * 0.16;
        let beside = simulator.at(place).ping_beside(direction_rad, offset).expect("few paths");
        let exact = simulator.at(place + offset).ping(direction_rad).expect("few paths");
        let is_clear = beside.margin_db.is_some_and(|margin_db| margin_db > 12.0);
        if is_clear && is_single_reflection(&beside) && is_single_reflection(&exact) {
            let ranges_m = [&beside, &exact].map(|of| of.range_m.expect("an echo"));
            // 32 cm of air absorb half a decibel, which delays a weak echo by some tenths of a
            // millimetre.
            assert!((ranges_m[0] - ranges_m[1]).abs() < 5e-4, "{ranges_m:?} at {place}");
            let at_point = simulator.at(place).ping(direction_rad).expect("few paths");
            assert!(at_point.range_m.is_some_and(|range_m| range_m > ranges_m[1] + 0.1));
            compared += 1;
        }
    }
    assert!(compared > 10, "{compared}");
}

/// Most readings agree with those at the transducer, also where another echo is the first from there,
/// for example near the end of blanking.
#[test]
fn most_readings_beside_a_point_are_those_of_the_transducer() {
    let simulator = room();
    let (mut same, mut all) = (0, 0);
    for (place, direction_rad) in firings() {
        let offset = DVec2::from_angle(direction_rad) * 0.16;
        let beside = simulator.at(place).ping_beside(direction_rad, offset).expect("few paths");
        let exact = simulator.at(place + offset).ping(direction_rad).expect("few paths");
        let is_near = match (beside.range_m, exact.range_m) {
            (Some(a), Some(b)) => (a - b).abs() < 3e-3,
            _ => true,
        };
        same += usize::from(beside.status == exact.status && is_near);
        all += 1;
        // A transducer at the point itself is the plain firing.
        let at_point = simulator.at(place).ping_beside(direction_rad, DVec2::ZERO);
        assert_eq!(at_point, simulator.at(place).ping(direction_rad));
        assert!(beside.status != PingStatus::Echo || beside.range_m.is_some());
    }
    assert!(same * 100 > all * 90, "{same} of {all}");
}
