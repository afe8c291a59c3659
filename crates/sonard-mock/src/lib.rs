//! Mock ranger: the device state machine on a pty, with echoes from the acoustic model or a log.
//!
//! [`World`] and [`MockBoard`] are a simulation without I/O; [`MockPort`] runs it on a
//! [`Pty`](sonard_device::link::Pty). The mock is used only on explicit request, and its identity
//! reports a simulated device.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod board;
mod faults;
mod identity;
mod invalid_replies;
mod memory;
mod note;
mod replay;
mod serve;
#[cfg(test)]
mod tests;
mod world;

pub use board::{MockBoard, Wake, WakeKind};
pub use faults::{DeviceFault, FAULT_HELP, FaultPlan, FaultSpecError, Faults};
pub use identity::{BoardSettings, Pace};
pub use invalid_replies::{INVALID_REPLIES, InvalidReply};
pub use memory::MemorySocket;
pub use note::Note;
pub use replay::{Replay, ReplayError, ReplayedReading};
pub use serve::MockPort;
pub use world::{EchoTable, Firing, World};
