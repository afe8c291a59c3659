//! What the device machine and the board say to each other.

use crate::messages::{Blanking, Capabilities, Echoes, FirmwareVersion, ReadingStatus, ResetCause};

/// Properties of the board, known at boot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Board {
    /// A number that no earlier boot had (best: a counter in EEPROM). 0 is taken for 1.
    pub boot: u16,
    /// Firmware version.
    pub firmware: FirmwareVersion,
    /// Serial number.
    pub serial: [u8; 10],
    /// Steps a revolution, with microstepping and gears counted in.
    pub steps_per_revolution: u16,
    /// What the board can do.
    pub capabilities: Capabilities,
    /// Why it booted.
    pub reset_cause: ResetCause,
}

/// An action that the board must carry out now. Actions are to be carried out in the order they come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Search the index and end on it, at the position that is zero from then on; without an
    /// index sensor, do nothing. Then call [`super::Device::handle_homed`].
    Home {
        /// Largest speed, steps/s.
        speed: u16,
        /// Acceleration, steps/s^2.
        acceleration: u32,
    },
    /// Turn to `target`. When the motor stands, call [`super::Device::handle_moved`].
    Move {
        /// Steps from home.
        target: i32,
        /// Largest speed, steps/s.
        speed: u16,
        /// Acceleration, steps/s^2.
        acceleration: u32,
    },
    /// Brake as fast as the acceleration allows. When the motor stands, call
    /// [`super::Device::handle_moved`] with where it stands: once, for the stop and what it
    /// stopped together.
    StopMotion,
    /// Stop the motor at once, if it turns, and let go of its coils. Nothing is reported.
    ReleaseCoils,
    /// Fire and listen for the whole window, then call [`super::Device::handle_echoes`].
    Fire {
        /// Listening time, ticks after firing.
        window_ticks: u32,
        /// Echoes to wait for, at most.
        max_echoes: u8,
        /// How long the receiver stays deaf.
        blanking: Blanking,
    },
    /// Take INIT away and forget the firing. Nothing is reported.
    AbortFire,
    /// Let the serial line drain, then restart.
    Reset,
}

/// The outcome of one [`Action::Fire`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EchoReport {
    /// Device clock when INIT rose, ticks.
    pub fired_ticks: u32,
    /// What the board saw. [`ReadingStatus::Echo`] without an echo counts as
    /// [`ReadingStatus::NoEcho`].
    pub status: ReadingStatus,
    /// Echo times, ticks after firing.
    pub echoes: Echoes,
}

/// The reason why homing failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HomeError {
    /// The index was not found within the search.
    IndexNotFound,
}
