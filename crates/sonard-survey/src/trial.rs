//! Trials of surveys: random rooms, simulated sweeps, an exploring robot, and the comparison of a
//! survey with the true room.

mod compare;
mod explorer;
mod readings;
mod rooms;
#[cfg(test)]
mod tests;

pub use compare::{Comparison, Ends, RigidMotion, coverage, is_post_at};
pub use explorer::{Explorer, ExplorerSettings, Way};
pub use readings::{ReadingNoise, simulate_rounds, simulate_sweeps, trial_world};
pub use rooms::{RoomKind, draw_place, draw_trial, drift, extent, generator, is_free, poses_along};
