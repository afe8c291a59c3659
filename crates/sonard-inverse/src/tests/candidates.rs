//! Threshold scan against the detections of a receiver.

use super::{first_pose, world};
use sonard_model::{acoustics::Latch, geometry::Pose};

use crate::{
    World,
    candidates::{CandidateList, Phases, SPAN_DB, ThresholdScan},
};

/// Where arrivals overlap, the first may fade before the next one continues the envelope, and a
/// slightly higher threshold delays an echo by centimetres without another arrival. That is another
/// candidate.
#[test]
fn two_step_rise_is_two_candidates() {
    let mut here = world("right-angle-corner", "senscomp-6500");
    here.sensor.threshold *= 0.5;
    let places = (-3..=3).map(|at| 0.1 * f64::from(at));
    let jumps: u32 = places.map(|x_m| jumps_from(&here, x_m)).sum();
    assert!(jumps > 10, "{jumps}");
}

/// Number of jumps of the range over thresholds, each of which must be at the end of a candidate.
fn jumps_from(here: &World, x_m: f64) -> u32 {
    let pose = Pose { x_m, y_m: -0.3, heading_deg: 0.0 };
    let simulator = here.simulator(&pose).expect("a model");
    let point = simulator.at(pose.position());
    let listener = ThresholdScan::new(simulator.receiver(), Phases::Known, SPAN_DB);
    let mut receiver = simulator.receiver().clone();
    let mut found = CandidateList::new();
    let mut jumps = 0;
    for step in 0..400 {
        let direction_rad = (0.9 * f64::from(step)).to_radians();
        listener.candidates(&point, direction_rad, &mut found).expect("paths");
        let mut read_m = |by_db: f64| {
            receiver.threshold = simulator.receiver().threshold * 10f64.powf(by_db / 20.0);
            let read =
                point.evaluate(direction_rad, |ear| ear.detect(&receiver, Latch::First, 0.0));
            read.expect("paths").range_m
        };
        for at in -40..40 {
            let by_db = 0.25 * f64::from(at);
            let Some((low_m, high_m)) = read_m(by_db).zip(read_m(by_db + 0.25)) else { continue };
            // No isolated pulse rises so slowly within a quarter of a decibel, except at its very
            // top.
            if high_m - low_m > 0.015 {
                jumps += 1;
                let ends = found.iter().map(|candidate| candidate.until_db);
                let nearest = ends.map(|end_db| (end_db - by_db).abs()).fold(f64::MAX, f64::min);
                assert!(nearest < 0.8, "{step}: from {low_m} to {high_m} at {by_db}: {found:?}");
            }
        }
    }
    jumps
}

#[test]
fn candidates_match_detections() {
    let (mut compared, mut wrong) = (0, 0);
    for (scene, sensor) in
        [("simple-room", "senscomp-6500"), ("oblique-corner", "pioneer"), ("corridor", "hc-sr04")]
    {
        let here = world(scene, sensor);
        let pose = first_pose(&here.scene);
        let simulator = here.simulator(&pose).expect("a model");
        let point = simulator.at(pose.position());
        let listener = ThresholdScan::new(simulator.receiver(), Phases::Known, SPAN_DB);
        let mut receiver = simulator.receiver().clone();
        let mut found = CandidateList::new();
        for step in 0..200 {
            let direction_rad = here.direction_rad(&pose, 1.8 * f64::from(step));
            listener.candidates(&point, direction_rad, &mut found).expect("paths");
            for by_db in [-9.3, -4.1, -1.7, 0.0, 0.8, 2.9, 6.2, 10.4] {
                receiver.threshold = simulator.receiver().threshold * 10f64.powf(by_db / 20.0);
                let read = point
                    .evaluate(direction_rad, |ear| ear.detect(&receiver, Latch::First, 0.0))
                    .expect("paths");
                let at = found.iter().position(|candidate| by_db < candidate.until_db);
                let candidate = &found[at.unwrap_or(found.len() - 1)];
                let off = match (candidate.range_m, read.range_m) {
                    (None, None) => 0.0,
                    (Some(candidate_m), Some(read_m)) => (candidate_m - read_m).abs() - 0.04,
                    _ => f64::INFINITY,
                };
                compared += 1;
                wrong += u32::from(off > 0.02);
                if off > 0.02 {
                    eprintln!(
                        "{scene} {step} {by_db}: {:?} for {:?}; {:?}",
                        candidate.range_m,
                        read.range_m,
                        found.iter().map(|c| (c.range_m, c.until_db)).collect::<Vec<_>>()
                    );
                }
            }
        }
    }
    eprintln!("{wrong} of {compared}");
    // Where echoes overlap, the peak may belong to an arrival after the one that triggered ECHO.
    assert!(f64::from(wrong) < 0.005 * f64::from(compared), "{wrong} of {compared}");
}
