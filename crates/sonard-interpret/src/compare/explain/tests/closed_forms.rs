//! Fits and gains with known closed forms.

use glam::DVec3;
use sonard_model::geometry::DVec2;
use sonard_records::{
    InteractionKind, InteractionRecord, PathKind, PathRecord, Ping, Point, ScanView,
};

use super::{
    super::{ChangedQuantity, Explainer, fit::fit},
    World,
};

/// Residuals that scatter by 5 mm about an offset: their mean, with the standard error of a mean.
#[test]
fn offset_is_mean_and_standard_error() {
    let all = (0..100).map(|at| (if at % 2 == 0 { 0.045 } else { 0.055 }, DVec3::X));
    let found = fit(all).expect("enough");
    assert!((found.value - 0.05 * DVec3::X).length() < 1e-5, "{found:?}");
    assert!((found.sigma.x / (0.005 / 10.0) - 1.0).abs() < 1e-3, "{found:?}");
    // All were off by more than two standard deviations of 1 cm, and now none is.
    assert_eq!(found.explains, 100);
    // Each gains 0.9 N(5 mm) + 0.1 / 5 m over about 0.1 / 5 m.
    let normal = |off: f64| 0.9 * (-0.5 * off * off).exp() / (0.01 * std::f64::consts::TAU.sqrt());
    let gain = |off: f64| ((normal(0.5) + 0.02) / (normal(off) + 0.02)).ln();
    assert!((found.gain - 50.0 * (gain(4.5) + gain(5.5))).abs() < 0.1, "{found:?}");
    assert_eq!(found.remaining_m((0.07, DVec3::new(0.5, 0.0, 3.0))), 0.07 - 0.5 * found.value.x);
}

/// Three values at once, of which a fraction is reported in percent.
#[test]
fn linear_changes_are_exact() {
    let truth = DVec3::new(0.02, -0.03, 0.01);
    let all = (0..60).map(|at| {
        let turn = DVec2::from_angle(0.4 * f64::from(at));
        let gain = turn.extend(-0.5 - 0.05 * f64::from(at));
        (gain.dot(truth), gain)
    });
    let found = fit(all).expect("enough");
    assert!((found.value - truth).length() < 2e-5, "{found:?}");
    let percent = found.estimate(ChangedQuantity::Percent, 2);
    assert_eq!((percent.value, percent.sigma), (100.0 * found.value.z, 100.0 * found.sigma.z));
    let y = found.estimate(ChangedQuantity::YM, 1);
    assert_eq!((y.value, y.sigma), (found.value.y, found.sigma.y));
}

#[test]
fn few_pairs_or_large_changes_are_no_fit() {
    let solve = |count: usize, off_m: f64| fit((0..count).map(|_| (off_m, DVec3::X)));
    assert_eq!(solve(4, 0.05), None);
    assert!(solve(5, 0.05).is_some());
    assert_eq!(fit((0..9).map(|_| (0.05, DVec3::ZERO))), None, "nothing depends on it");
    // Beyond 15 cm, or 6 % of the speed of sound, the first order does not hold.
    assert!(solve(50, 0.14).is_some());
    assert_eq!(solve(50, 0.16), None);
}

/// A ranger facing a wall along x, with sound that bounces between wall and transducer. A step
/// towards the wall shortens each round trip by two, and the range by one per round trip.
#[test]
fn multiple_bounces_add_up() {
    let (mut scan, _) = World::assumed().scan();
    let from = World::assumed().pose.position();
    let wall_m = 0.7;
    let interaction = |kind, id: &str, at: DVec2| InteractionRecord {
        kind,
        id: id.into(),
        point: Point::Plan(at.to_array()),
    };
    for bounces in 1..=3_usize {
        let at_wall = || interaction(InteractionKind::Reflection, "w", from + wall_m * DVec2::X);
        let mut interactions = vec![at_wall()];
        for _ in 1..bounces {
            interactions.push(interaction(InteractionKind::Transducer, "transducer", from));
            interactions.push(at_wall());
        }
        let length_m = 2.0 * wall_m * bounces as f64;
        let order = bounces as u32;
        let path = PathRecord { kind: PathKind::Specular, order, interactions, length_m };
        let pair = linearized(&mut scan, path).expect("a pair");
        let trips = bounces as f64;
        assert!((pair.d_position + trips * DVec2::X).length() < 1e-9, "{bounces}: {pair:?}");
        // Moving the wall away lengthens each trip.
        assert_eq!(pair.d_walls.len(), 1);
        assert!((pair.d_walls[0].1 - trips).abs() < 1e-9, "{bounces}: {pair:?}");
    }
    // A path via the floor needs heights, which only the model has.
    let floor = interaction(InteractionKind::Reflection, "floor", from + 0.3 * DVec2::X);
    let path =
        PathRecord { kind: PathKind::Specular, order: 1, interactions: vec![floor], length_m: 1.0 };
    assert_eq!(linearized(&mut scan, path), None);
}

fn linearized(scan: &mut ScanView, path: PathRecord) -> Option<super::super::LinearizedPair> {
    let (predicted, simulator) = World::assumed().scan();
    let mut ping: Ping = predicted.pings[0].clone();
    let point = simulator.at(World::assumed().pose.position());
    let prediction = point.ping(0.0).expect("few paths");
    let mut sim = sonard_records::SimRecord::from_prediction(&simulator, &prediction);
    sim.path = Some(path);
    ping.sim = Some(sim);
    Explainer::default().pair(scan, &ping, Some(0.0))
}
