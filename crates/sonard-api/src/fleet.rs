//! Several daemons looked at together: who they are, how each answers, and one task that goes on asking.
//!
//! Each is asked by itself, in a time and a number of bytes that are bounded: one that is silent,
//! refuses, or answers something else delays no other. [`judge`] and [`Roll`] are pure.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod ask;
mod judge;
mod member;
mod picture;
mod roll;
mod watch;

pub use ask::{Told, ask};
pub use judge::{Seen, Unheard, judge, plain};
pub use member::{Asked, MOST_MEMBERS, Member, MemberError, check_all, members_of, read_members};
pub use roll::Roll;
pub use watch::watch;
