//! The wire protocol of the sonard ranger, and the state machines of both its ends.
#![no_std]

pub mod frame;
pub mod messages;
