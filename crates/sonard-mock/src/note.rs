//! Messages of the mock for its console.

use std::fmt;

use super::faults::DeviceFault;

/// Message for the console of the mock.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Note {
    /// Boot of the device, with its nonce.
    Booted(u16),
    /// Homing of the motor, with the drift in steps.
    Homed(i32),
    /// Number of firings since power-up.
    Fired(u64),
    /// Stop of the motor on request, with its step.
    Stopped(i32),
    /// First firing of a replayed scan: its number, and the number of scans.
    Replayed(usize, usize),
    /// Release of the coils.
    CoilsReleased,
    /// Injected fault.
    Fault(DeviceFault),
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Booted(boot) => write!(f, "booted, nonce {boot:04x}"),
            Self::Homed(0) => f.write_str("homed"),
            Self::Homed(drift) => write!(f, "homed, the index was {drift} steps off"),
            Self::Fired(count) => write!(f, "{count} firings"),
            Self::Stopped(step) => write!(f, "motor stopped at step {step}"),
            Self::Replayed(scan, scans) => write!(f, "replaying scan {scan} of {scans}"),
            Self::CoilsReleased => f.write_str("coils released"),
            Self::Fault(fault) => write!(f, "fault: {fault}"),
        }
    }
}
