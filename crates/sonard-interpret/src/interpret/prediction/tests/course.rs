//! Feature Prediction on a long course through one room with simulated readings.

use std::sync::Arc;

use jiff::Timestamp;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use uuid::Uuid;

use crate::interpret::{
    Extents, Sweep,
    prediction::{FeaturePrediction, PredictionSettings},
};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    model::{Options, Simulator},
    scene::{Scene, shipped},
};
use sonard_records::{PathKind, Ping, ScanPlan, ScanView};

/// Minimum distance of the robot from a wall, metres.
const CLEARANCE_M: f64 = 0.4;

/// Distance between scans, metres.
const STRIDE_M: f64 = 0.15;

/// Extension of walls, metres, as in `sonard map`.
const EXTEND_M: f64 = 2.0;
/// Minimum confidence of a trusted reading, as in `sonard map`.
const MIN_CONFIDENCE: f64 = 0.48;

/// The L-shaped room.
fn simulator() -> Simulator {
    let scene = Scene::from_json(shipped::text("two-surface-room").expect("shipped"));
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    Simulator::new(Arc::new(scene.expect("a scene")), sensor, Air::default(), Options::default())
        .expect("sensible figures")
}

/// Random trajectory with minimal turns.
fn wander(scene: &Scene, places: usize, seed: u64) -> Vec<Pose> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut pose = scene.pose("middle").expect("a pose");
    let mut poses = vec![pose];
    while poses.len() < places {
        let (turn_deg, next) = (0..)
            .find_map(|tries| {
                let turn_deg = (17.0 + 3.0 * f64::from(tries)) * rng.random_range(-1.0..1.0);
                let ahead = DVec2::from_angle(pose.direction_rad(turn_deg));
                let half = pose.position() + STRIDE_M / 2.0 * ahead;
                let next = pose.position() + STRIDE_M * ahead;
                let free = |at: DVec2| scene.clearance_m(at) >= CLEARANCE_M;
                (free(half) && free(next)).then_some((turn_deg, next))
            })
            .expect("a free step");
        pose = Pose { x_m: next.x, y_m: next.y, heading_deg: pose.heading_deg + turn_deg };
        poses.push(pose);
    }
    poses
}

/// Fractions of trusted readings in each fifty scans: of direct wall readings, and of readings that
/// are far too long due to several reflections.
fn trusted_shares(scans: usize, seed: u64) -> Vec<[f64; 2]> {
    let simulator = simulator();
    let extents = Extents::new(simulator.sensor(), simulator.air(), false).expect("figures");
    let mut prediction = FeaturePrediction::new(PredictionSettings {
        extend_m: EXTEND_M,
        ..PredictionSettings::stepper(extents.plane_corner_deg(1.0, 1.0), 5.0)
    });
    let mut counts = vec![[[0_usize; 2]; 2]; scans.div_ceil(50)];
    for (number, pose) in wander(simulator.scene(), scans, seed).iter().enumerate() {
        let (id, plan) = (Uuid::from_u128(number as u128), ScanPlan::default());
        let scan = ScanView::simulated(&simulator, id, pose, &plan, Timestamp::UNIX_EPOCH)
            .expect("few paths");
        let sweep = Sweep::from_scan(&scan).expect("a sweep");
        for (beam, assessment) in sweep.beams.iter().zip(prediction.assess(&sweep)) {
            let Some(kind) = kind(&scan.pings[beam.index as usize]) else { continue };
            let [all, trusted] = &mut counts[number / 50][kind];
            *all += 1;
            *trusted += usize::from(assessment.confidence > MIN_CONFIDENCE);
        }
    }
    let share = |[all, trusted]: [usize; 2]| trusted as f64 / all as f64;
    counts.into_iter().map(|kinds| kinds.map(share)).collect()
}

/// Class of a reading: 0 for a direct wall echo, 1 for three or more reflections. Corners are
/// neither: their range is correct, but not for all of their beams.
fn kind(ping: &Ping) -> Option<usize> {
    let path = ping.path.as_ref()?;
    match (path.kind, path.order) {
        (PathKind::Specular, 1) => Some(0),
        (PathKind::Specular, 3..) => Some(1),
        _ => None,
    }
}

#[test]
fn trust_does_not_decay_over_500_scans() {
    for seed in [1, 2] {
        let shares = trusted_shares(500, seed);
        println!("{shares:.3?}");
        let ([first, _], [last, _]) = (shares[0], shares[shares.len() - 1]);
        assert!(first > 0.70, "seed {seed}: {shares:.3?}");
        assert!(last > first - 0.05, "seed {seed}: {shares:.3?}");
        let too_long = shares.iter().map(|[_, too_long]| *too_long).fold(0.0, f64::max);
        assert!(too_long < 0.03, "seed {seed}: {shares:.3?}");
    }
}
