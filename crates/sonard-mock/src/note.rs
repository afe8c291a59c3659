//! What the mock tells the person who watches it.

use std::fmt;

use super::faults::DeviceFault;

/// A message for a person watching the mock.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Note {
    /// The device booted with this nonce.
    Booted(u16),
    /// The motor went home; the index was off by so many steps.
    Homed(i32),
    /// So many firings since boot.
    Fired(u64),
    /// The motor stopped on request, at this step.
    Stopped(i32),
    /// The coils were let go.
    CoilsReleased,
    /// A fault was played.
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
            Self::CoilsReleased => f.write_str("coils released"),
            Self::Fault(fault) => write!(f, "fault: {fault}"),
        }
    }
}
