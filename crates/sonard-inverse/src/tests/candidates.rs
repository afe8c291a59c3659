//! What a receiver could report against what it reports.

use super::{first_pose, world};
use sonard_model::acoustics::Latch;

use crate::candidates::{Listener, Phases};

#[test]
fn at_each_threshold_the_candidate_is_what_a_receiver_with_it_reports() {
    let (mut asked, mut wrong) = (0, 0);
    for (scene, sensor) in
        [("simple-room", "senscomp-6500"), ("oblique-corner", "pioneer"), ("corridor", "hc-sr04")]
    {
        let here = world(scene, sensor);
        let pose = first_pose(&here.scene);
        let simulator = here.simulator(&pose).expect("a model");
        let point = simulator.at(pose.position());
        let mut listener = Listener::new(simulator.receiver(), Phases::Known, false);
        let mut receiver = simulator.receiver().clone();
        for step in 0..200 {
            let direction_rad = here.direction_rad(&pose, 1.8 * f64::from(step));
            let found = listener.candidates(&point, direction_rad).expect("paths");
            for by_db in [-9.3, -4.1, -1.7, 0.0, 0.8, 2.9, 6.2, 10.4] {
                receiver.threshold = simulator.receiver().threshold * 10f64.powf(by_db / 20.0);
                let read = point
                    .hear(direction_rad, |ear| ear.detect(&receiver, Latch::First, 0.0))
                    .expect("paths");
                let at = found.iter().position(|candidate| by_db < candidate.until_db);
                let said = &found[at.unwrap_or(found.len() - 1)].prediction;
                let off = match (said.range_m, read.range_m) {
                    (None, None) => 0.0,
                    (Some(said_m), Some(read_m)) => (said_m - read_m).abs() - 0.04,
                    _ => f64::INFINITY,
                };
                asked += 1;
                wrong += u32::from(off > 0.02);
                if off > 0.02 {
                    eprintln!(
                        "{scene} {step} {by_db}: {:?} for {:?}; {:?}",
                        said.range_m,
                        read.range_m,
                        found
                            .iter()
                            .map(|c| (c.prediction.range_m, c.until_db))
                            .collect::<Vec<_>>()
                    );
                }
            }
        }
    }
    eprintln!("{wrong} of {asked}");
    // Where echoes overlap, a peak may be of an arrival after the one that raised ECHO.
    assert!(f64::from(wrong) < 0.005 * f64::from(asked), "{wrong} of {asked}");
}
