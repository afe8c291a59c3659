//! Diagnosis of readings that a calibration leaves unexplained.

use crate::inverse::{CoarseGrid, FitResult, FitSweep, PoseMode, World, diagnose, locate};

/// Minimum share of explained readings for an alternative pose to be suggested.
const MIN_EXPLAINED: f64 = 0.7;

/// Describes likely causes for the sweeps of a poor fit: wrong unit, reversed sense of rotation,
/// wrong pose or wrong room. Each sweep is located in the initial scene, because a failed fit
/// distorts sensor and walls to match readings of other objects.
pub(super) fn describe_misfits(
    world: &World,
    sweeps: &[FitSweep],
    fitted: &FitResult,
) -> Vec<String> {
    if !fitted.is_poorly_explained() {
        return Vec::new();
    }
    notice!("many readings are unexplained: looking for the cause");
    let Ok(atlas) = CoarseGrid::new(world, CoarseGrid::default_spacing_m(&world.scene)) else {
        return Vec::new();
    };
    let of = |sweep: &FitSweep| {
        let modes = locate(world, &atlas, sweep).ok()?;
        let wrong = diagnose(world, &atlas, sweep, &modes);
        let elsewhere =
            || modes.iter().find(|mode| mode.explained >= MIN_EXPLAINED).map(describe_pose);
        let reason = wrong.first().map(ToString::to_string).or_else(elsewhere)?;
        Some(format!("warning: scan {:08x}: {reason}", sweep.scan.as_fields().0))
    };
    sweeps.iter().filter_map(of).collect()
}

fn describe_pose(mode: &PoseMode) -> String {
    format!(
        "the initial scene explains {:.0} % of its readings from the pose {:.2},{:.2},{:.0}: check the scan's pose",
        100.0 * mode.explained,
        mode.x_m,
        mode.y_m,
        mode.heading_deg
    )
}
