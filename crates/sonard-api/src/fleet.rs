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

pub use member::{
    MAX_MEMBERS, Member, MemberError, PolledDaemon, check_members, members_from_keys, read_members,
};
pub use poll::{DaemonReport, poll};
pub use registry::Registry;
pub use state::{Observation, PollError, observe, sanitize};
pub use watch::watch_fleet;
