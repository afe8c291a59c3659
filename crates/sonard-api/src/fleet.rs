//! Polling of several daemons: members, their state, and a task that keeps it up to date.
//!
//! Each daemon is polled independently, with limits on time and bytes, so one that does not respond
//! or sends something else delays no other. Registry and derivation of states are pure.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod member;
mod picture;
mod poll;
mod registry;
mod state;
mod watch;

pub use member::{Asked, MAX_MEMBERS, Member, MemberError, check_all, members_of, read_members};
pub use poll::{Told, ask};
pub use registry::Roll;
pub use state::{Seen, Unheard, judge, plain};
pub use watch::watch;
