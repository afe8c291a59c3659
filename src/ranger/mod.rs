//! Drives a ranger over its protocol.

mod clock;

pub use clock::{ClockFit, HostTime, TickExtender};
