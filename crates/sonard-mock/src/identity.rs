//! Identity and settings of the mock board.

use firmware_protocol::{
    device::Board,
    messages::{Capabilities, FirmwareVersion, ResetCause},
};

use super::faults::FaultPlan;

/// Settings of the mock board.
#[derive(Debug, Clone, Copy)]
pub struct BoardSettings {
    /// Boot nonce of the first boot.
    pub boot: u16,
    /// Device clock at the first boot, ticks.
    pub clock: u32,
    /// Motor steps per revolution.
    pub steps_per_revolution: u16,
    /// Probabilities of injected faults.
    pub faults: FaultPlan,
    /// Seed of the faults.
    pub seed: u64,
    /// Real or virtual time; a virtual clock is reported to the host.
    pub pace: Pace,
    /// Readings are those of a log, which is reported to the host.
    pub is_replay: bool,
}

/// Passage of device time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// Device time passes in real time.
    RealTime,
    /// Device time jumps to the next event; only the host's lease is measured in real time.
    Virtual,
}

/// Builds the identity of the board, always as a simulated device.
pub(super) fn identity(settings: &BoardSettings, boot: u16, reset_cause: ResetCause) -> Board {
    let echoes = match settings.is_replay {
        true => Capabilities::REPLAYED,
        false => Capabilities::default(),
    };
    let clock = match settings.pace {
        Pace::RealTime => Capabilities::default(),
        Pace::Virtual => Capabilities::VIRTUAL_CLOCK,
    };
    Board {
        boot,
        firmware: FirmwareVersion { major: 0, minor: 1, patch: 0 },
        serial: if settings.is_replay { *b"REPLAY-001" } else { *b"MOCK-00001" },
        steps_per_revolution: settings.steps_per_revolution,
        capabilities: Capabilities::INDEX_SENSOR
            .with(Capabilities::SHORT_BLANKING)
            .with(Capabilities::MULTIPLE_ECHOES)
            .with(Capabilities::COIL_RELEASE)
            .with(Capabilities::SIMULATED)
            .with(echoes)
            .with(clock),
        reset_cause,
    }
}
