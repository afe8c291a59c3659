//! Types exchanged between the device state machine and the board.

use crate::messages::{Blanking, Capabilities, Echoes, FirmwareVersion, ReadingStatus, ResetCause};

/// Properties of the board, known at boot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Board {
    /// Number that differs from that of all earlier boots (best: a counter in EEPROM). 0 is
    /// replaced by 1.
    pub boot: u16,
    /// Version of the firmware.
    pub firmware: FirmwareVersion,
    /// Serial number, unique to the board.
    pub serial: [u8; 10],
    /// Steps per revolution, including microstepping and gears.
    pub steps_per_revolution: u16,
    /// Features of the board.
    pub capabilities: Capabilities,
    /// Cause of the last reset.
    pub reset_cause: ResetCause,
}

/// Action that the board must carry out immediately. Actions are carried out in the order received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Searches for the index and ends on it; that position is zero from then on. Without an index
    /// sensor nothing moves. Then call [`super::Device::handle_homed`].
    Home {
        /// Maximum speed of the move, steps/s.
        speed: u16,
        /// Acceleration and deceleration, steps/s^2.
        acceleration: u32,
    },
    /// Moves to `target`. When the motor is at rest, call [`super::Device::handle_moved`].
    Move {
        /// Target position, steps from home.
        target: i32,
        /// Maximum speed of the move, steps/s.
        speed: u16,
        /// Acceleration and deceleration, steps/s^2.
        acceleration: u32,
    },
    /// Brakes as fast as the acceleration allows. When the motor is at rest, call
    /// [`super::Device::handle_moved`] with its position: once, for the stop and the interrupted
    /// move together.
    StopMotion,
    /// Stops the motor at once, if it turns, and releases its coils. No call follows.
    ReleaseCoils,
    /// Fires and records echoes for the whole window, then calls [`super::Device::handle_echoes`].
    Fire {
        /// Listening window, ticks after firing.
        window_ticks: u32,
        /// Maximum number of echoes to wait for.
        max_echoes: u8,
        /// Receiver blanking after firing.
        blanking: Blanking,
    },
    /// Deasserts INIT and discards the firing. No call follows.
    AbortFire,
    /// Waits until the serial line has drained, then restarts.
    Reset,
}

/// Result of one [`Action::Fire`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EchoReport {
    /// Device clock when INIT rose, ticks.
    pub fired_ticks: u32,
    /// Outcome of the firing. [`ReadingStatus::Echo`] without an echo is treated as
    /// [`ReadingStatus::NoEcho`].
    pub status: ReadingStatus,
    /// Echo times, ticks after firing.
    pub echoes: Echoes,
}

/// Reason for a failure of homing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HomeError {
    /// The index was not found during the search.
    IndexNotFound,
}
