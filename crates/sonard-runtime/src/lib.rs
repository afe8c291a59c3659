//! Process level of the sonard programs: task supervision, shutdown signals, messages on stderr,
//! back-off, state of the wall clock.
//!
//! A [`Supervisor`](supervisor::Supervisor) owns all long-lived tasks and threads and turns the
//! unexpected end of one into an orderly shutdown. [`messages`] writes the log messages of the
//! process through a bounded queue, so that a blocked or closed stderr never delays a task.
//! [`interrupts`] counts stop signals. The crate contains nothing about rangers.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

pub mod backoff;
pub mod interrupts;
pub mod messages;
pub mod platform;
pub mod supervisor;
pub mod wall_clock;
