//! Calibration of the probabilities in random rooms, with the complete receiver.

use super::{ArcCause, ClassifiedArc, Reliability, classify_room};
use sonard_interpret::interpret::{InterpretSettings, Probabilities};
use sonard_model::acoustics::Sensor;

fn classified(seed: u64, rooms: u64) -> Vec<ClassifiedArc> {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let settings = InterpretSettings::default();
    (0..rooms).flat_map(|number| classify_room(seed, number, &sensor, &settings)).collect()
}

#[test]
fn probabilities_are_calibrated() {
    let classified = classified(7, 100);
    let reliability = Reliability::from_arcs(&classified);
    println!("{} arcs: {reliability:#.3?}", classified.len());
    assert!(classified.len() > 500, "{}", classified.len());
    assert!(reliability.expected_error < 0.03, "{reliability:#.3?}");
    assert!(reliability.brier < 0.10, "{reliability:#.3?}");
}

#[test]
fn confident_arcs_are_correct() {
    let mut counts = [0_usize; 2];
    for arc in classified(8, 100) {
        let probabilities = arc.probabilities;
        for (claimed, truth) in [
            (probabilities.plane, ArcCause::Plane),
            (probabilities.corner, ArcCause::Corner),
            (probabilities.edge, ArcCause::Edge),
        ] {
            if claimed >= 0.9 {
                counts[usize::from(arc.truth == truth)] += 1;
            }
        }
    }
    let [wrong, right] = counts;
    assert!(right > 50, "{wrong} of {}", wrong + right);
    assert!(10 * wrong <= wrong + right, "{wrong} of {}", wrong + right);
}

/// Two arcs computed by hand: 0.85 occurs once in two, 0.1 once in two, 0.05 and 0 never in four.
#[test]
fn statistics_match_their_definitions() {
    let probabilities = Probabilities { plane: 0.85, corner: 0.1, edge: 0.05, other: 0.0 };
    let classified =
        [ArcCause::Plane, ArcCause::Corner].map(|truth| ClassifiedArc { probabilities, truth });
    let Reliability { bins, expected_error, brier } = Reliability::from_arcs(&classified);
    for (at, count, claimed, came_true) in [(0, 4, 0.025, 0.0), (1, 2, 0.1, 0.5), (8, 2, 0.85, 0.5)]
    {
        assert_eq!(bins[at].count, count, "{bins:?}");
        assert!((bins[at].mean_predicted - claimed).abs() < 1e-12, "{bins:?}");
        assert!((bins[at].observed - came_true).abs() < 1e-12, "{bins:?}");
    }
    assert_eq!(bins.iter().map(|bin| bin.count).sum::<usize>(), 8);
    // (|1.7 - 1| + |0.2 - 1| + |0.1 - 0|) / 8
    assert!((expected_error - 0.2).abs() < 1e-12, "{expected_error}");
    let first = 0.15 * 0.15 + 0.1 * 0.1 + 0.05 * 0.05;
    let second = 0.85 * 0.85 + 0.9 * 0.9 + 0.05 * 0.05;
    assert!((brier - (first + second) / 8.0).abs() < 1e-12, "{brier}");

    let certain = Probabilities { edge: 1.0, ..Probabilities::default() };
    let right =
        Reliability::from_arcs(&[ClassifiedArc { probabilities: certain, truth: ArcCause::Edge }]);
    assert_eq!((right.expected_error, right.brier, right.bins[9].count), (0.0, 0.0, 1));
    let wrong =
        Reliability::from_arcs(&[ClassifiedArc { probabilities: certain, truth: ArcCause::Other }]);
    assert_eq!((wrong.expected_error, wrong.brier), (0.5, 0.5));
    assert_eq!(Reliability::from_arcs(&[]).brier, 0.0);
}
