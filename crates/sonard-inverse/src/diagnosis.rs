//! Diagnosis of a sweep that the scene does not explain.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    coarse_grid::CoarseGrid,
    locate::PoseMode,
    sweep::{FiringOutcome, FitSweep, SweepFiring},
    world::World,
};

/// Likely cause of a poor fit of a sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Misfit {
    /// Scene that explains few of the readings whatever is changed: another place, or another time.
    OtherPlace {
        /// Fraction of the readings that are explained.
        explained: f64,
    },
    /// Azimuths recorded clockwise instead of counter-clockwise.
    Clockwise,
    /// Azimuths recorded in radians instead of degrees.
    Radians,
    /// Ranges in another unit.
    Unit {
        /// Factor that converts the ranges.
        factor: f64,
    },
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherPlace { explained } => write!(
                f,
                "no pose in this scene explains more than {:.0} % of the readings: is it another room, or has it \
                 changed?",
                100.0 * explained
            ),
            Self::Clockwise => f.write_str(
                "the readings fit far better with reversed azimuths: are they clockwise?",
            ),
            Self::Radians => f.write_str(
                "the readings fit far better with azimuths in radians: are they not in degrees?",
            ),
            Self::Unit { factor } => write!(
                f,
                "the readings fit far better with ranges multiplied by {factor}: are they in another unit?"
            ),
        }
    }
}

/// Fraction of explained readings below which a sweep is diagnosed.
const MIN_EXPLAINED: f64 = 0.7;
/// Maximum cost of the coarse match after a correction, relative to that before.
const FAR_BETTER: f32 = 0.6;
/// Factors of unit errors: centimetres, millimetres, inches, feet, and two-way ranges.
const FACTORS: [f64; 8] = [0.01, 100.0, 0.001, 1000.0, 0.0254, 0.3048, 0.5, 2.0];

/// Diagnoses a sweep whose best pose explains little of it; empty for others.
#[must_use]
pub fn diagnose(
    world: &World,
    atlas: &CoarseGrid,
    sweep: &FitSweep,
    modes: &[PoseMode],
) -> Vec<Misfit> {
    let explained = modes.iter().map(|mode| mode.explained).fold(0.0, f64::max);
    if explained >= MIN_EXPLAINED {
        return Vec::new();
    }
    let cost = |sweep: &FitSweep| {
        let best = atlas.matches(world, sweep, 1);
        best.first().map_or(f32::INFINITY, |best| best.cost)
    };
    let now = cost(sweep);
    let changed = |change: &dyn Fn(SweepFiring) -> SweepFiring| FitSweep {
        beams: sweep.beams.iter().copied().map(change).collect(),
        ..sweep.clone()
    };
    let turned = |factor: f64| {
        cost(&changed(&|beam| SweepFiring { azimuth_deg: factor * beam.azimuth_deg, ..beam }))
    };
    let scaled = |factor: f64| {
        cost(&changed(&|beam| match beam.outcome {
            FiringOutcome::Echo { tof_us } => {
                SweepFiring { outcome: FiringOutcome::Echo { tof_us: factor * tof_us }, ..beam }
            }
            FiringOutcome::NoEcho | FiringOutcome::BelowMinRange => beam,
        }))
    };
    let tried = [(Misfit::Clockwise, turned(-1.0)), (Misfit::Radians, turned(1f64.to_degrees()))];
    let units = FACTORS.map(|factor| (Misfit::Unit { factor }, scaled(factor)));
    let best = tried.into_iter().chain(units).min_by(|a, b| a.1.total_cmp(&b.1));
    match best {
        Some((cause, cost)) if cost < FAR_BETTER * now => vec![cause],
        _ => vec![Misfit::OtherPlace { explained }],
    }
}
