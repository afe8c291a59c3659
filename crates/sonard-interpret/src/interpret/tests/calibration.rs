//! How far the probabilities can be believed, on rooms with a real receiver.

use crate::interpret::{
    Settings,
    calibration::{Judged, Reliability, Truth, judge_room},
};
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
