//! A mock ranger: the device machine on a pty, with sound from the model.
//!
//! [`World`] and [`MockBoard`] are a simulation without I/O; [`MockPort`] plays it on a
//! [`Pty`](sonard_device::link::Pty).
//! It is only ever used when asked for by name, and it says of itself that it is simulated.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod board;
mod faults;
mod identity;
mod liar;
mod memory;
mod note;
mod serve;
#[cfg(test)]
mod tests;
mod world;

pub use board::{MockBoard, Wake, WakeKind};
pub use faults::{DeviceFault, FAULT_HELP, FaultPlan, FaultSpecError, Faults};
pub use identity::{BoardSettings, Pace};
pub use liar::{LIES, Lie};
pub use memory::MemorySocket;
pub use note::Note;
pub use serve::MockPort;
pub use world::{Soundings, World};
