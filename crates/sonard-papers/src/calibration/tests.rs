//! How far the probabilities can be believed, on rooms with a real receiver.

use super::{Judged, Reliability, Truth, judge_room};
use sonard_interpret::interpret::{Probabilities, Settings};
use sonard_model::acoustics::Sensor;

fn judged(seed: u64, rooms: u64) -> Vec<Judged> {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let settings = Settings::default();
    (0..rooms).flat_map(|number| judge_room(seed, number, &sensor, &settings)).collect()
}

#[test]
fn probabilities_come_true_as_often_as_they_say() {
    let judged = judged(7, 100);
    let reliability = Reliability::of(&judged);
    println!("{} arcs: {reliability:#.3?}", judged.len());
    assert!(judged.len() > 500, "{}", judged.len());
    assert!(reliability.expected_error < 0.03, "{reliability:#.3?}");
    assert!(reliability.brier < 0.10, "{reliability:#.3?}");
}

#[test]
fn certain_edges_and_planes_are_there() {
    let mut sure = [0_usize; 2];
    for arc in judged(8, 100) {
        let said = arc.said;
        for (claimed, truth) in
            [(said.plane, Truth::Plane), (said.corner, Truth::Corner), (said.edge, Truth::Edge)]
        {
            if claimed >= 0.9 {
                sure[usize::from(arc.truth == truth)] += 1;
            }
        }
    }
    let [wrong, right] = sure;
    assert!(right > 50, "{wrong} of {}", wrong + right);
    assert!(10 * wrong <= wrong + right, "{wrong} of {}", wrong + right);
}

/// Two arcs by hand: of 0.85 twice one came true, of 0.1 twice one, of 0.05 and 0 four times none.
#[test]
fn reliability_is_counted_as_its_definitions_say() {
    let said = Probabilities { plane: 0.85, corner: 0.1, edge: 0.05, other: 0.0 };
    let judged = [Truth::Plane, Truth::Corner].map(|truth| Judged { said, truth });
    let Reliability { bins, expected_error, brier } = Reliability::of(&judged);
    for (at, count, claimed, came_true) in [(0, 4, 0.025, 0.0), (1, 2, 0.1, 0.5), (8, 2, 0.85, 0.5)]
    {
        assert_eq!(bins[at].count, count, "{bins:?}");
        assert!((bins[at].claimed - claimed).abs() < 1e-12, "{bins:?}");
        assert!((bins[at].came_true - came_true).abs() < 1e-12, "{bins:?}");
    }
    assert_eq!(bins.iter().map(|bin| bin.count).sum::<usize>(), 8);
    // (|1.7 - 1| + |0.2 - 1| + |0.1 - 0|) / 8
    assert!((expected_error - 0.2).abs() < 1e-12, "{expected_error}");
    let of_first = 0.15 * 0.15 + 0.1 * 0.1 + 0.05 * 0.05;
    let of_second = 0.85 * 0.85 + 0.9 * 0.9 + 0.05 * 0.05;
    assert!((brier - (of_first + of_second) / 8.0).abs() < 1e-12, "{brier}");

    let sure = Probabilities { edge: 1.0, ..Probabilities::default() };
    let right = Reliability::of(&[Judged { said: sure, truth: Truth::Edge }]);
    assert_eq!((right.expected_error, right.brier, right.bins[9].count), (0.0, 0.0, 1));
    let wrong = Reliability::of(&[Judged { said: sure, truth: Truth::Other }]);
    assert_eq!((wrong.expected_error, wrong.brier), (0.5, 0.5));
    assert_eq!(Reliability::of(&[]).brier, 0.0);
}
