//! What may be wrong with readings that a scene does not explain.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    atlas::Atlas,
    locate::Mode,
    sweep::{Beam, Heard, Sweep},
    world::World,
};

/// A likely fault of a sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Doubt {
    /// The scene explains few of the readings, whatever is done to them: it is of another place, or of another time.
    OtherPlace {
        /// Share of the readings that are explained.
        explained: f64,
    },
    /// They would fit if azimuths were counted the other way round.
    Clockwise,
    /// They would fit if azimuths were radians.
    Radians,
    /// They would fit if ranges were in another unit.
    Unit {
        /// What ranges are to be multiplied with.
        factor: f64,
    },
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherPlace { explained } => write!(
                f,
                "no pose in this scene explains more than {:.0} % of the readings: is it another room, or has it \
                 changed?",
                100.0 * explained
            ),
            Self::Clockwise => f.write_str(
                "the readings fit far better with azimuths counted the other way round: are they clockwise?",
            ),
            Self::Radians => {
                f.write_str("the readings fit far better with azimuths in radians: are they no degrees?")
            }
            Self::Unit { factor } => write!(
                f,
                "the readings fit far better with ranges multiplied by {factor}: are they in another unit?"
            ),
        }
    }
}

/// Below this share of explained readings something is wrong.
const FEW: f64 = 0.7;
/// What is wrong must make the first look's cost this much smaller.
const FAR_BETTER: f32 = 0.6;
/// Units that ranges are mixed up in: centimetres, millimetres, inches and feet, there and back.
const FACTORS: [f64; 8] = [0.01, 100.0, 0.001, 1000.0, 0.0254, 0.3048, 0.5, 2.0];

/// What may be wrong with a sweep whose best pose explains little of it; nothing of others.
#[must_use]
pub fn doubts(world: &World, atlas: &Atlas, sweep: &Sweep, modes: &[Mode]) -> Vec<Doubt> {
    let explained = modes.iter().map(|mode| mode.explained).fold(0.0, f64::max);
    if explained >= FEW {
        return Vec::new();
    }
    let cost = |sweep: &Sweep| {
        let best = atlas.matches(world, sweep, 1);
        best.first().map_or(f32::INFINITY, |best| best.cost)
    };
    let now = cost(sweep);
    let changed = |change: &dyn Fn(Beam) -> Beam| Sweep {
        beams: sweep.beams.iter().copied().map(change).collect(),
        ..sweep.clone()
    };
    let turned = |factor: f64| {
        cost(&changed(&|beam| Beam { azimuth_deg: factor * beam.azimuth_deg, ..beam }))
    };
    let scaled = |factor: f64| {
        cost(&changed(&|beam| match beam.heard {
            Heard::Echo { tof_us } => {
                Beam { heard: Heard::Echo { tof_us: factor * tof_us }, ..beam }
            }
            Heard::Silence | Heard::Near => beam,
        }))
    };
    let tried = [(Doubt::Clockwise, turned(-1.0)), (Doubt::Radians, turned(1f64.to_degrees()))];
    let units = FACTORS.map(|factor| (Doubt::Unit { factor }, scaled(factor)));
    let best = tried.into_iter().chain(units).min_by(|one, other| one.1.total_cmp(&other.1));
    match best {
        Some((doubt, cost)) if cost < FAR_BETTER * now => vec![doubt],
        _ => vec![Doubt::OtherPlace { explained }],
    }
}
