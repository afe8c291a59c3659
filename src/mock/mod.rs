//! A mock ranger: the device machine on a pty, with sound from the model.

mod faults;
mod pty;

pub use faults::{DeviceFault, FAULT_HELP, FaultPlan, FaultSpecError, Faults};
pub use pty::Pty;
