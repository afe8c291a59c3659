//! Configuration and commands of the host.

use crate::messages::{Settings, Sweep};

/// Transmissions of a request, without a reply, before the device counts as absent: about nine
/// seconds, longer than a board needs to boot after a reset caused by opening its port.
pub const ATTEMPTS: u8 = 7;
/// Times that the expected duration of the work may pass while a device still replies Started.
pub const OVERRUNS: u8 = 3;
/// Transmissions of the Stop after the host has given up on a request.
pub const STOP_ATTEMPTS: u8 = 3;
/// Margin of a reply beyond the time of bytes and work, before the first sample, us.
pub const INITIAL_MARGIN_US: u32 = 200_000;
/// Minimum margin beyond the mean, us.
pub const MIN_MARGIN_US: u32 = 20_000;
/// Maximum margin, including the back-off of repetitions, us.
pub const MAX_MARGIN_US: u32 = 2_000_000;
/// Minimum number of requests that a host sends per lease during a sweep.
pub const KEEP_ALIVES_PER_LEASE: u8 = 3;
/// Number of acknowledgements while the device's ring of readings fills.
pub const ACKNOWLEDGEMENTS_PER_RING: u8 = 4;
/// Number of readings accepted ahead of the lowest missing one.
pub const READINGS_AHEAD: u8 = 64;
/// Maximum number by which a host starts ahead of the last sequence number that the device
/// accepted.
pub const SEQ_GAP_MAX: u16 = 256;

/// Parameters that the host machine cannot determine by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostConfig {
    /// Bit rate of the line, bit/s; a byte takes ten bits.
    pub baud: u32,
    /// Number that differs between runs: seed of sequence and sweep numbers.
    pub seed: u32,
    /// Transmissions of a request, without a reply, before the device counts as absent.
    pub max_attempts: u8,
    /// Times that the expected duration of the work may pass while a device still replies Started.
    pub max_overruns: u8,
    /// Margin of a reply beyond the time of bytes and work, before the first sample, us.
    pub initial_margin_us: u32,
    /// Minimum margin beyond the mean, us.
    pub min_margin_us: u32,
    /// Maximum margin, including the back-off of repetitions, us.
    pub max_margin_us: u32,
}

impl HostConfig {
    /// Creates a configuration that suits a USB serial adapter.
    #[must_use]
    pub const fn new(baud: u32, seed: u32) -> Self {
        Self {
            baud,
            seed,
            max_attempts: ATTEMPTS,
            max_overruns: OVERRUNS,
            initial_margin_us: INITIAL_MARGIN_US,
            min_margin_us: MIN_MARGIN_US,
            max_margin_us: MAX_MARGIN_US,
        }
    }
}

/// Command to the host machine, one at a time; only [`Command::Stop`] may interrupt another
/// command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Identifies the device. Ends with [`super::HostEvent::Identified`].
    Identify,
    /// Sets motion and ranging parameters.
    Configure(Settings),
    /// Searches for the home position.
    Home,
    /// Moves to a position, steps from home.
    MoveTo {
        /// Target position, steps from home.
        step: i32,
    },
    /// Fires once. A [`super::HostEvent::Reading`] precedes the end.
    Ping,
    /// Executes a plan of beams. The host assigns the number [`Sweep::sweep`]. Ends with
    /// [`super::HostEvent::SweepDone`].
    Sweep(Sweep),
    /// Queries the state of the device.
    Status,
    /// Stops the command in progress.
    Stop,
    /// Restarts the device. Identify must follow.
    Reset,
}

/// Reason for not starting a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StartError {
    /// Another command is in progress.
    Busy,
    /// Identify is required first.
    NotIdentified,
    /// The device restarted, or the line was closed, since the last Identify. Identify is required
    /// again.
    Restarted,
    /// Configure is required first, because the host derives its timeouts from the settings.
    NotConfigured,
    /// The plan has no beams, or more than the maximum.
    EmptySweep,
}

impl core::fmt::Display for StartError {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.write_str(match self {
            Self::Busy => "another command is in progress",
            Self::NotIdentified => "the device has not been identified",
            Self::Restarted => {
                "the device restarted or the line was closed since it was identified"
            }
            Self::NotConfigured => "the device has not been configured",
            Self::EmptySweep => "a sweep must have 1 to 65535 beams",
        })
    }
}

impl core::error::Error for StartError {}
