//! Trials of surveys: random rooms, simulated sweeps, and the comparison of a survey with the true
//! room.

mod compare;
mod readings;
mod rooms;

pub use compare::{Comparison, Ends, RigidMotion, coverage, is_post_at};
pub use readings::{ReadingNoise, simulate_sweeps};
pub use rooms::{
    RoomKind, add_posts, draw_course, draw_place, draw_room, drift, extent, generator, is_free,
};
