//! Fits and gains whose values are known.

use glam::DVec3;
use sonard_model::geometry::DVec2;
use sonard_records::{
    InteractionKind, InteractionRecord, PathKind, PathRecord, Ping, Point, ScanView,
};

use super::{
    super::{Explainer, Quantity, fit::fit},
    World,
};

/// Residuals that scatter by 5 mm about an offset: their mean, with the standard error of a mean.
#[test]
fn an_offset_is_a_mean_with_its_standard_error() {
    let all = (0..100).map(|at| (if at % 2 == 0 { 0.045 } else { 0.055 }, DVec3::X));
    let found = fit(all).expect("enough");
    assert!((found.value - 0.05 * DVec3::X).length() < 1e-5, "{found:?}");
    assert!((found.sigma.x / (0.005 / 10.0) - 1.0).abs() < 1e-3, "{found:?}");
    // All were off by more than two spreads of 1 cm, and now none is.
    assert_eq!(found.explains, 100);
    // Each gains 0.9 N(5 mm) + 0.1 / 5 m beside all but nothing and 0.1 / 5 m.
    let normal = |off: f64| 0.9 * (-0.5 * off * off).exp() / (0.01 * std::f64::consts::TAU.sqrt());
    let of = |off: f64| ((normal(0.5) + 0.02) / (normal(off) + 0.02)).ln();
    assert!((found.gain - 50.0 * (of(4.5) + of(5.5))).abs() < 0.1, "{found:?}");
    assert_eq!(found.left_m((0.07, DVec3::new(0.5, 0.0, 3.0))), 0.07 - 0.5 * found.value.x);
}

/// Three values at once, of which a share is told in percent.
#[test]
fn what_is_linear_is_found_exactly() {
    let truth = DVec3::new(0.02, -0.03, 0.01);
    let all = (0..60).map(|at| {
        let turn = DVec2::from_angle(0.4 * f64::from(at));
        let gain = turn.extend(-0.5 - 0.05 * f64::from(at));
        (gain.dot(truth), gain)
    });
    let found = fit(all).expect("enough");
    assert!((found.value - truth).length() < 2e-5, "{found:?}");
    let percent = found.estimate(Quantity::Percent, 2);
    assert_eq!((percent.value, percent.sigma), (100.0 * found.value.z, 100.0 * found.sigma.z));
    let y = found.estimate(Quantity::YM, 1);
    assert_eq!((y.value, y.sigma), (found.value.y, found.sigma.y));
}

#[test]
fn too_few_and_too_much_are_no_fit() {
    let of = |count: usize, off_m: f64| fit((0..count).map(|_| (off_m, DVec3::X)));
    assert_eq!(of(4, 0.05), None);
    assert!(of(5, 0.05).is_some());
    assert_eq!(fit((0..9).map(|_| (0.05, DVec3::ZERO))), None, "nothing depends on it");
    // Beyond 15 cm, or 6 % of the speed of sound, nothing is of first order.
    assert!(of(50, 0.14).is_some());
    assert_eq!(of(50, 0.16), None);
}

/// A ranger that looks along x at a wall, and sound that goes to the wall and back as often as it meets the
/// wall: a step towards the wall makes each way there and back shorter by two, and the range by one for each.
#[test]
fn sound_between_wall_and_face_gains_by_each_way() {
    let (mut scan, _) = World::believed().scan();
    let from = World::believed().pose.position();
    let wall_m = 0.7;
    let met = |kind, id: &str, at: DVec2| InteractionRecord {
        kind,
        id: id.into(),
        point: Point::Plan(at.to_array()),
    };
    for meetings in 1..=3_usize {
        let at_wall = || met(InteractionKind::Reflection, "w", from + wall_m * DVec2::X);
        let mut interactions = vec![at_wall()];
        for _ in 1..meetings {
            interactions.push(met(InteractionKind::Transducer, "transducer", from));
            interactions.push(at_wall());
        }
        let length_m = 2.0 * wall_m * meetings as f64;
        let order = meetings as u32;
        let path = PathRecord { kind: PathKind::Specular, order, interactions, length_m };
        let pair = pair_of(&mut scan, path).expect("a pair");
        let ways = meetings as f64;
        assert!((pair.by_place + ways * DVec2::X).length() < 1e-9, "{meetings}: {pair:?}");
        // And the wall itself, moved away from it, makes each longer.
        assert_eq!(pair.by_wall.len(), 1);
        assert!((pair.by_wall[0].1 - ways).abs() < 1e-9, "{meetings}: {pair:?}");
    }
    // Sound off the floor has heights, which only the model knows.
    let floor = met(InteractionKind::Reflection, "floor", from + 0.3 * DVec2::X);
    let path =
        PathRecord { kind: PathKind::Specular, order: 1, interactions: vec![floor], length_m: 1.0 };
    assert_eq!(pair_of(&mut scan, path), None);
}

fn pair_of(scan: &mut ScanView, path: PathRecord) -> Option<super::super::Pair> {
    let (predicted, simulator) = World::believed().scan();
    let mut ping: Ping = predicted.pings[0].clone();
    let point = simulator.at(World::believed().pose.position());
    let prediction = point.ping(0.0).expect("few paths");
    let mut sim = sonard_records::SimRecord::of(&simulator, &prediction);
    sim.path = Some(path);
    ping.sim = Some(sim);
    Explainer::default().pair(scan, &ping, Some(0.0))
}
