//! Interpretation against the paper's figures and densities, and on random worlds.

mod blanked;
mod degenerate;
mod densities;
mod mapping;
mod paper;
mod probabilities;
mod sweep;
mod worlds;

use std::sync::Arc;

use jiff::Timestamp;
use uuid::Uuid;

use super::{Extents, Feature, InterpretSettings, Sweep, interpret};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::{EdgeLawKind, PathOptions, Simulator},
    scene::Scene,
};
use sonard_records::{ScanPlan, ScanView};

/// The paper's model: its sensor with a gain that compensates absorption, a detector without time
/// walk, and its edges.
fn simulator(scene: Arc<Scene>) -> Simulator {
    let sensor = Sensor::preset("bozma-kuc-60khz").expect("a preset");
    let options = PathOptions {
        lossless: true,
        edge_law: Some(EdgeLawKind::BozmaKuc),
        ideal_receiver: true,
        ..PathOptions::default()
    };
    Simulator::new(scene, sensor, Air::default(), options.into()).expect("sensible figures")
}

fn scan(simulator: &Simulator, number: u128, pose: &Pose) -> ScanView {
    let (id, plan) = (Uuid::from_u128(number), ScanPlan::default());
    ScanView::simulated(simulator, id, pose, &plan, Timestamp::UNIX_EPOCH).expect("few paths")
}

fn features(scans: &[ScanView], settings: &InterpretSettings) -> Vec<Feature> {
    let session = scans[0].session.as_ref().expect("a session");
    let extents = Extents::from_session(session).expect("sensible figures");
    let sweeps: Vec<_> =
        scans.iter().map(|scan| (scan.scan, Sweep::from_scan(scan).expect("a sweep"))).collect();
    interpret(&sweeps, &extents, settings)
}
