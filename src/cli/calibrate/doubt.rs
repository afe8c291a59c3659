//! What may be wrong with readings that a calibration does not explain.

use crate::inverse::{Atlas, Fitted, Mode, Sweep, World, doubts, locate};

/// Below this share of explained readings a pose is not the answer either.
const LEAST_EXPLAINED: f64 = 0.7;

/// Sentences about the sweeps of a fit that left a good part of the readings unexplained: readings in another unit or
/// counted the other way round, another pose, another room. Each sweep is located in the scene as it was believed, because a fit
/// that went wrong bends sensor and walls to readings that are none of theirs.
pub(super) fn doubts_of(world: &World, sweeps: &[Sweep], fitted: &Fitted) -> Vec<String> {
    if !fitted.is_doubtful() {
        return Vec::new();
    }
    notice!("a good part of the readings is not explained: looking for the reason");
    let Ok(atlas) = Atlas::new(world, Atlas::usual_spacing_m(&world.scene)) else {
        return Vec::new();
    };
    let of = |sweep: &Sweep| {
        let modes = locate(world, &atlas, sweep).ok()?;
        let wrong = doubts(world, &atlas, sweep, &modes);
        let elsewhere = || modes.iter().find(|mode| mode.explained >= LEAST_EXPLAINED).map(at);
        let reason = wrong.first().map(ToString::to_string).or_else(elsewhere)?;
        Some(format!("doubt: scan {:08x}: {reason}", sweep.scan.as_fields().0))
    };
    sweeps.iter().filter_map(of).collect()
}

fn at(mode: &Mode) -> String {
    format!(
        "as believed, the scene explains {:.0} % of its readings from the pose {:.2},{:.2},{:.0}: was it taken there?",
        100.0 * mode.explained,
        mode.x_m,
        mode.y_m,
        mode.heading_deg
    )
}
