//! Multiple echoes by the transducer's own face.

use super::*;
use crate::model::Mechanism;

/// The amplitude of an arrival is its path's strength times the beam pattern at both of its ends.
#[test]
fn arrivals_include_the_beam() {
    let room = scene(vec![
        wall("wall", (0.5, -3.0), (0.5, 3.0), 1.0),
        wall("far", (-1.0, -3.0), (2.0, 3.0), 0.9),
    ]);
    let simulator = simulator(room, PathOptions { lossless: true, ..PathOptions::default() });
    let mut multiples = 0;
    for direction_deg in [0.0_f64, 4.0, -7.0] {
        let direction_rad = direction_deg.to_radians();
        let point = simulator.at(DVec2::new(0.0, 0.2));
        for arrival in point.arrivals(direction_rad).expect("few paths") {
            let returns = arrival
                .path
                .mechanisms()
                .filter(|mechanism| *mechanism == Mechanism::Transducer)
                .count();
            let one_way = |end_rad: f64| {
                simulator.beam().one_way(crate::geometry::wrap_pi(end_rad - direction_rad))
            };
            let ends = one_way(arrival.departure_rad) * one_way(arrival.arrival_rad);
            let expected = arrival.path_amplitude * ends;
            assert!(
                (arrival.amplitude - expected).abs() <= 1e-6 * arrival.amplitude,
                "{direction_deg}: {arrival:?} {ends}"
            );
            multiples += usize::from(returns > 0);
        }
    }
    assert!(multiples > 1, "{multiples}");
}

/// Multiple echoes in front of one wall: `n` round trips are `n` times as long, and leave and
/// return along the wall's normal.
#[test]
fn length_is_that_of_all_rounds() {
    let before = scene(vec![wall("wall", (0.5, -3.0), (0.5, 3.0), 1.0)]);
    let simulator = simulator(before, PathOptions { lossless: true, ..PathOptions::default() });
    let arrivals = simulator.at(DVec2::ZERO).arrivals(0.05).expect("few paths");
    let mirrored: Vec<_> = arrivals
        .iter()
        .filter(|arrival| {
            arrival
                .path
                .mechanisms()
                .all(|mechanism| !matches!(mechanism, Mechanism::Diffraction(_)))
        })
        .collect();
    assert!(mirrored.len() >= 2, "{mirrored:?}");
    for (arrival, rounds) in mirrored.iter().zip(1..) {
        assert!((arrival.length_m - f64::from(rounds)).abs() < 1e-9, "{arrival:?}");
        assert!(
            arrival.departure_rad.abs() < 1e-9 && arrival.arrival_rad.abs() < 1e-9,
            "{arrival:?}"
        );
        assert_eq!(arrival.path.interactions.len(), 2 * rounds as usize - 1);
    }
}

/// With single contacts the arrivals are those of all that touch a cylinder at most once, and no edge
/// besides.
#[test]
fn single_contacts_are_a_part_of_all() {
    let mut room = scene(vec![
        wall("left", (-1.0, -1.0), (-1.0, 2.0), 0.97),
        wall("top", (-1.0, 2.0), (2.0, 2.0), 0.97),
        wall("pier", (1.2, -0.6), (1.2, 0.2), 0.97),
    ]);
    room.cylinders = vec![cylinder((0.7, 0.6), 0.35), cylinder((-0.4, 0.7), 0.3)];
    let all = simulator(room, Options::default());
    let single = all.with_single_contacts().expect("the same scene");
    let contacts = |path: &Path| {
        let is_round = |of: &Reflector| matches!(of, Reflector::Cylinder(_));
        let round = path.reflectors().filter(is_round).count();
        if round == 0 { 0 } else { round + path.diffractors().count() }
    };
    let (from, mut repeated) = (DVec2::new(0.1, -0.3), 0);
    for direction_deg in (-180..180).step_by(15) {
        let of = |simulator: &Simulator| {
            let found = simulator.at(from).arrivals(f64::from(direction_deg).to_radians());
            found.expect("few paths")
        };
        let (mut expected, found) = (of(&all), of(&single));
        let count = expected.len();
        expected.retain(|arrival| contacts(&arrival.path) <= 1);
        repeated += count - expected.len();
        assert_eq!(found, expected, "{direction_deg}");
    }
    assert!(repeated > 10, "{repeated}");
}
