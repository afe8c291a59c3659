//! Causes of sweeps that no pose explains.

use std::sync::Arc;

use sonard_model::{acoustics::Sensor, geometry::Pose, scene::Scene};
use uuid::Uuid;

use super::world;
use crate::{CoarseGrid, FiringOutcome, FitSweep, Misfit, SweepFiring, World, diagnose, locate};

const STEP_DEG: f64 = 3.0;

/// Readings of a world from a pose, each changed by `change`.
fn sweep(of: &World, pose: Pose, change: impl Fn(SweepFiring) -> SweepFiring) -> FitSweep {
    let simulator = of.simulator(&pose).expect("a world");
    let (point, speed_m_s) = (simulator.at(pose.position()), simulator.sound_speed_m_s());
    let beams = (0..120).map(|stop| {
        let azimuth_deg = STEP_DEG * f64::from(stop);
        let reading = point.ping(of.direction_rad(&pose, azimuth_deg)).expect("a prediction");
        let outcome = match (reading.status, reading.range_m) {
            (sonard_records::PingStatus::Echo, Some(range_m)) => {
                FiringOutcome::Echo { tof_us: 2e6 * range_m / speed_m_s }
            }
            (sonard_records::PingStatus::MinRange, _) => FiringOutcome::BelowMinRange,
            _ => FiringOutcome::NoEcho,
        };
        change(SweepFiring { azimuth_deg, outcome })
    });
    FitSweep { scan: Uuid::nil(), pose, beams: beams.collect() }
}

/// Causes found for a sweep in a world.
fn causes(assumed: &World, sweep: &FitSweep) -> Vec<Misfit> {
    let grid = CoarseGrid::new(assumed, 0.1).expect("free positions");
    let modes = locate(assumed, &grid, sweep).expect("a world");
    diagnose(assumed, &grid, sweep, &modes)
}

fn lab() -> World {
    let mut lab = world("mcgill-lab", "senscomp-6500");
    lab.options.max_range_m = Some(4.0);
    lab
}

const POSE: Pose = Pose { x_m: 3.477, y_m: 1.48, heading_deg: 0.0 };

#[test]
fn a_fitting_sweep_has_no_cause() {
    assert_eq!(causes(&lab(), &sweep(&lab(), POSE, |beam| beam)), Vec::new());
}

#[test]
fn reversed_azimuths_and_units_are_found() {
    let reversed = |beam: SweepFiring| SweepFiring { azimuth_deg: -beam.azimuth_deg, ..beam };
    assert_eq!(causes(&lab(), &sweep(&lab(), POSE, reversed)), [Misfit::Clockwise]);
    let halved = |beam: SweepFiring| match beam.outcome {
        FiringOutcome::Echo { tof_us } => {
            SweepFiring { outcome: FiringOutcome::Echo { tof_us: 0.5 * tof_us }, ..beam }
        }
        _ => beam,
    };
    let found = causes(&lab(), &sweep(&lab(), POSE, halved));
    assert_eq!(found, [Misfit::Unit { factor: 2.0 }]);
}

/// A few readings fit somewhere after some correction, by chance.
#[test]
fn few_readings_prove_no_correction() {
    let all = sweep(&lab(), POSE, |beam| beam);
    let echoes = all.beams.iter().filter(|beam| beam.is_echo()).step_by(9).copied();
    let few = FitSweep { beams: echoes.collect(), ..all };
    assert!(few.beams.len() < 15, "{}", few.beams.len());
    let found = causes(&world("simple-room", "senscomp-6500"), &few);
    assert!(matches!(found[0], Misfit::OtherPlace { .. }), "{found:?}");
    assert!(found.len() > 1, "{found:?}");
}

/// Ranges from 2 cm on, which the assumed sensor's blanking excludes.
#[test]
fn another_sensor_is_recognized_by_its_limits() {
    let room = world("simple-room", "hc-sr04");
    let near = Pose { x_m: 0.774, y_m: 0.085, heading_deg: 0.0 };
    let assumed =
        World { sensor: Sensor::preset("senscomp-6500").expect("a preset"), ..room.clone() };
    let found = causes(&assumed, &sweep(&room, near, |beam| beam));
    assert!(matches!(found[0], Misfit::OtherPlace { .. }), "{found:?}");
    let limits = found.iter().find_map(|cause| match cause {
        Misfit::SensorLimits { share, min_range_m, .. } => Some((*share, *min_range_m)),
        _ => None,
    });
    let (share, min_range_m) = limits.expect("limits");
    assert!(share > 0.2 && (min_range_m - 0.409).abs() < 1e-3, "{found:?}");
}

#[test]
fn a_larger_place_is_recognized_by_its_ranges() {
    let text = r#"{"name": "closet", "materials": {"wood": {"reflectance": 0.3}}, "walls": [
        {"id": "w", "polyline": [[0, 0], [0.6, 0], [0.6, 0.5], [0, 0.5]], "closed": true, "material": "wood"}]}"#;
    let closet = Arc::new(Scene::from_json(text).expect("a scene"));
    let assumed = World { scene: closet, ..lab() };
    let found = causes(&assumed, &sweep(&lab(), POSE, |beam| beam));
    let beyond = found.iter().find_map(|cause| match cause {
        Misfit::BeyondScene { share, diagonal_m } => Some((*share, *diagonal_m)),
        _ => None,
    });
    let (share, diagonal_m) = beyond.expect("ranges beyond the scene");
    assert!(share > 0.3 && (diagonal_m - 0.6f64.hypot(0.5)).abs() < 1e-9, "{found:?}");
    for cause in &found {
        assert!(!cause.advice().is_empty() && !cause.advice().ends_with('.'), "{cause}");
    }
}
