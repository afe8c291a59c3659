//! Angular extents of Bozma and Kuc's figure 13, by the full simulation of their scan.

use super::*;
use crate::{
    model::{Mechanism, Prediction},
    reading::PingStatus,
    scan_plan::ScanPlan,
};

const STEP_DEG: f64 = 0.9;

/// A run of readings by the same reflector: its mean azimuth and its extent, from the first to the
/// last azimuth and half a step on each side, degrees.
struct Run {
    by: String,
    middle_deg: f64,
    extent_deg: f64,
}

/// Walls and edges of a path.
fn names(simulator: &Simulator, arrival: &Arrival) -> String {
    let scene = simulator.scene();
    let name = |mechanism: Mechanism| match mechanism {
        Mechanism::Diffraction(diffractor) => format!("edge {}", diffractor.name(scene)),
        _ => mechanism.name(scene),
    };
    arrival.path.mechanisms().map(name).collect::<Vec<_>>().join(", ")
}

fn runs(simulator: &Simulator, readings: &[(f64, Prediction)]) -> Vec<Run> {
    let by = |prediction: &Prediction| {
        let has_echo = prediction.status == PingStatus::Echo;
        let arrival = prediction.arrival.as_ref().filter(|_| has_echo)?;
        Some(names(simulator, arrival))
    };
    let mut runs: Vec<Run> = Vec::new();
    let mut last = None;
    // Begins at an azimuth without echo, so that no run is cut in two at 0.
    let start =
        readings.iter().position(|(_, p)| by(p).is_none()).expect("an azimuth without echo");
    for (azimuth_deg, prediction) in readings[start..].iter().chain(&readings[..start]) {
        let here = by(prediction);
        match (&here, &last) {
            (Some(name), Some(before)) if name == before => {
                let run = runs.last_mut().expect("a run has begun");
                run.extent_deg += STEP_DEG;
                run.middle_deg += STEP_DEG / 2.0;
            }
            (Some(name), _) => {
                runs.push(Run { by: name.clone(), middle_deg: *azimuth_deg, extent_deg: STEP_DEG });
            }
            (None, _) => {}
        }
        last = here;
    }
    runs
}

/// Planes and the corner extend over 23.3 degrees, edges over 7.8 at 47 cm and 8.0 at 44 cm.
#[test]
fn extents_match_bozma_kuc() {
    let scene = shipped_scene("plane-corner-edge");
    let pose = pose(&scene, "fig13");
    let sensor = Sensor::preset("bozma-kuc-60khz").expect("a preset");
    let air = Air::default().with_sound_speed(343.0).expect("a speed");
    let simulator =
        Simulator::new(Arc::new(scene), sensor, air, Options::default()).expect("good options");
    let plan = ScanPlan { step_deg: STEP_DEG, ..ScanPlan::default() };
    let readings: Vec<_> = simulator
        .predict(&pose, &plan)
        .expect("few paths")
        .into_iter()
        .zip(0..)
        .map(|(prediction, stop)| (plan.azimuth_deg(stop), prediction))
        .collect();
    let found = runs(&simulator, &readings);
    for run in &found {
        println!("{}: {:.2} degrees at {:.1}", run.by, run.extent_deg, run.middle_deg);
    }
    let of = |by: &str| {
        let run = found.iter().find(|run| run.by == by);
        run.unwrap_or_else(|| panic!("no run by {by}")).extent_deg
    };
    for plane in ["plane-1", "plane-2", "plane-3"] {
        close(of(plane), 23.3, 0.9, plane);
    }
    let corner: f64 = found
        .iter()
        .filter(|run| run.by.contains("plane-2") && run.by.contains("plane-3"))
        .map(|run| run.extent_deg)
        .sum();
    close(corner, 23.3, 0.9, "corner");
    let edge = |name: &str| {
        let runs = found.iter().filter(|run| run.by.starts_with(&format!("edge {name}")));
        runs.map(|run| run.extent_deg).sum::<f64>()
    };
    close(edge("edge-47cm"), 7.8, 0.9, "edge at 47 cm");
    close(edge("edge-44cm"), 8.0, 0.9, "edge at 44 cm");
}
